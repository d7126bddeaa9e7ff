"""The command that lists batches."""

from dataclasses import dataclass

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
