"""The command that archives, deletes and restores ended jobs."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class MadeVisible:
    """The answer to a change of a job's visibility."""

    outcome: Literal["done", "illegal"]
    state: str = ""  #: if illegal, the state that forbids it, or ``missing``
    before: str = ""  #: if done, the visibility before


@dataclass(frozen=True, kw_only=True)
class SetVisibility(Command[MadeVisible]):
    """List an ended job, archive it, or delete it."""

    job: str
    visibility: str
