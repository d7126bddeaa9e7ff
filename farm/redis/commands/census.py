"""The farm is counted."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class Work:
    """What the open jobs of one class have to give."""

    waiting: int  #: slices
    leased: int
    left: float  #: until the jobs end
    work_ms: float  #: what one worker would take for those, by what their jobs' slices took
    unmeasured: float  #: those left of jobs without any


@dataclass(frozen=True, kw_only=True)
class CensusRow:
    """The farm at one moment, as `plateau.farm.ledger.totals.Census` has it."""

    now: str  #: ms
    oldest: str | None = None  #: ms
    jobs: dict[str, int]
    stored: int
    created: int
    unserved: int
    demand: dict[str, Work]
    workers: dict[str, int]
    monitors: int
    owned: int
    webhooks: int
    totals: dict[str, int]


@dataclass(frozen=True, kw_only=True)
class Census(Command[CensusRow]):
    """Count the farm."""

    alive_ms: int  #: a worker that was not heard of for longer is gone
    least_priority: int | None  #: of jobs that are demand
