"""Which scenes are stored, and which are wanted."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class UseScene(Command[bool]):
    """Note that a scene is wanted; whether its blob is just being removed is answered."""

    sha256: str


@dataclass(frozen=True, kw_only=True)
class DisuseScene(Command[None]):
    """Take the note back."""

    sha256: str


@dataclass(frozen=True, kw_only=True)
class RememberScene(Command[None]):
    """Note that the blob store has a scene."""

    sha256: str
    summary: str  #: JSON


@dataclass(frozen=True, kw_only=True)
class NoteScenes(Command[None]):
    """Take scenes to be used now of which nobody knows when they were."""

    scenes: tuple[str, ...]  #: their SHA-256


@dataclass(frozen=True, kw_only=True)
class ForgetScene(Command[Literal["forgotten", "kept"]]):
    """Forget a scene that was not used since a moment."""

    sha256: str
    before_ms: int
    going_ms: int  #: the longest that the removal of its blob may take


@dataclass(frozen=True, kw_only=True)
class SceneGone(Command[None]):
    """Say that the blob of a forgotten scene is removed."""

    sha256: str
