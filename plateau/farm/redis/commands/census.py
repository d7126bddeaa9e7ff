"""The command that counts the farm."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command, Items


@dataclass(frozen=True, kw_only=True)
class Work:
    """The slices of the open jobs of one class."""

    waiting: int
    leased: int
    left: float  #: until the jobs end
    work_ms: float  #: one worker's time for those, by the mean of their job's slices
    unmeasured: float  #: of those left, the slices of jobs without a mean


@dataclass(frozen=True, kw_only=True)
class CensusRow:
    """The farm at one moment, as `plateau.farm.ledger.totals.Census` has it."""

    now: str  #: ms
    oldest: str | None = None  #: ms
    jobs: dict[str, int]
    stored: int
    created: int
    unserved: Items[str]
    demand: dict[str, Work]
    workers: dict[str, int]
    monitors: int
    owned: int
    notices: int
    totals: dict[str, int]


@dataclass(frozen=True, kw_only=True)
class Census(Command[CensusRow]):
    """Count the farm."""

    alive_ms: int  #: a worker without a heartbeat for longer is dead
    least_priority: int | None  #: of jobs that count as demand
