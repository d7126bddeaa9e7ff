"""The command that archives, deletes and restores ended jobs."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class MadeVisible:
    """The answer to a change of a job's visibility."""

    outcome: Literal["done", "illegal", "changed"]
    state: str = ""  #: if illegal, the state that forbids it, or ``missing``
    before: str = ""  #: if done, the visibility before


@dataclass(frozen=True, kw_only=True)
class SetVisibility(Command[MadeVisible]):
    """List an ended job, archive it, or delete it."""

    job: str
    visibility: str
    compared: str  #: number of the newest job of its guarded batch that it was compared with, or ""
