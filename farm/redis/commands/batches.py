"""Commands that list and guard batches."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command, Items


@dataclass(frozen=True, kw_only=True)
class BatchRow:
    """A batch in a list of them."""

    name: str
    number: int  #: of its newest job
    jobs: int
    newest_at: str | None = None  #: when its newest job was created (ms)
    states: dict[str, int]  #: how many jobs are in each


@dataclass(frozen=True, kw_only=True)
class Batches(Command[Items[BatchRow]]):
    """List batches, by their newest jobs."""

    before: int | None  #: the number that those are below
    limit: int


@dataclass(frozen=True, kw_only=True)
class Guard(Command[Literal["guarded", "changed", "missing"]]):
    """Let a batch take only jobs that stop as its own do."""

    batch: str
    compared: str  #: number of its newest job when its jobs were compared
