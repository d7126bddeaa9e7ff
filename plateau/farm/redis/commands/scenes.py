"""Commands that keep the index of scenes, and their use."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class UseScene(Command[bool]):
    """Note the use of a scene; answers whether its blob is being removed."""

    sha256: str


@dataclass(frozen=True, kw_only=True)
class DisuseScene(Command[None]):
    """Take the note of a use back."""

    sha256: str


@dataclass(frozen=True, kw_only=True)
class RememberScene(Command[None]):
    """Note that the blob store has a scene."""

    sha256: str
    summary: str  #: JSON


@dataclass(frozen=True, kw_only=True)
class NoteScenes(Command[None]):
    """Note a use now for scenes without one."""

    scenes: tuple[str, ...]  #: their SHA-256


@dataclass(frozen=True, kw_only=True)
class ForgetScene(Command[Literal["forgotten", "kept"]]):
    """Forget a scene that was last used before a moment."""

    sha256: str
    before_ms: int
    going_ms: int  #: longest time of the removal of its blob


@dataclass(frozen=True, kw_only=True)
class SceneGone(Command[None]):
    """Note that the blob of a forgotten scene is removed."""

    sha256: str
