"""Commands that keep the index of scenes, and their use."""

from typing import Literal

from plateau.farm.redis.commands.command import Command


class UseScene(Command[bool]):
    """Note the use of a scene; answers whether its blob is being removed."""

    sha256: str


class DisuseScene(Command[None]):
    """Take the note of a use back."""

    sha256: str


class RememberScene(Command[None]):
    """Note that the blob store has a scene."""

    sha256: str
    summary: str  #: JSON


class NoteScenes(Command[None]):
    """Note a use now for scenes without one."""

    scenes: tuple[str, ...]  #: their SHA-256


class ForgetScene(Command[Literal["forgotten", "kept"]]):
    """Forget a scene that was last used before a moment."""

    sha256: str
    before_ms: int
    going_ms: int  #: longest time of the removal of its blob


class SceneGone(Command[None]):
    """Note that the blob of a forgotten scene is removed."""

    sha256: str
