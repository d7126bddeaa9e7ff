"""The command that deletes and restores ended jobs."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class Deleted:
    """The answer to a job's deletion or restoration."""

    outcome: Literal["done", "illegal"]
    state: str = ""  #: if illegal, the state that forbids it, or ``missing``


@dataclass(frozen=True, kw_only=True)
class SetDeleted(Command[Deleted]):
    """Delete an ended job, or restore it."""

    job: str
    deleted: bool
