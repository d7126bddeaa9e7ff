"""The queue: slices are leased to workers, who commit them or give them back."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command

CommitEnd = Literal["committed", "duplicate", "ended", "stale", "overlap"]


@dataclass(frozen=True, kw_only=True)
class LeasedSlice:
    """A slice, and what is needed to render it."""

    job: str
    entry: str  #: of the job's stream
    index: int
    tries: int  #: how often it was leased, this time included
    variant: str
    spec: str  #: JSON
    scene: str  #: its SHA-256


@dataclass(frozen=True, kw_only=True)
class Offer:
    """What a worker gets that asks for a slice."""

    slice: LeasedSlice | None = None
    again: bool = False  #: what was come upon needed no rendering: ask again
    wait_ms: float | None = None  #: where there is none: when another worker's may be late


@dataclass(frozen=True, kw_only=True)
class Lease(Command[Offer]):
    """Ask for the next slice."""

    worker: str
    kind: str  #: `plateau.farm.model.fit.Kind`
    loaded: str  #: the job whose scene it has loaded, or ""
    in_turn: bool  #: whether its turn with that job lasts
    lease_ms: int
    most_tries: int


@dataclass(frozen=True, kw_only=True)
class Commit(Command[CommitEnd]):
    """Enter a rendered slice into the ledger."""

    job: str
    entry: str
    worker: str
    index: int
    record: str  #: JSON of a `plateau.farm.ledger.queue.SliceRecord`
    machine_ms: int
    width: int
    height: int
    notes: str  #: JSON
    variant: str
    said: str  #: what the render child printed


@dataclass(frozen=True, kw_only=True)
class Glimpse(Command[Literal["noted", "lost", "late"]]):
    """Say where the first pass of a job's first slice is."""

    job: str
    entry: str
    worker: str
    blob: str


@dataclass(frozen=True, kw_only=True)
class Died(Command[Literal["put back", "poisoned", "lost"]]):
    """Say that a render child died on a slice."""

    job: str
    entry: str
    worker: str
    index: int
    cause: str
    most_tries: int
    machine_ms: int
    said: str


@dataclass(frozen=True, kw_only=True)
class HandBack(Command[Literal["put back", "lost"]]):
    """Give a slice back unharmed."""

    job: str
    entry: str
    worker: str
    index: int
    what: Literal["handed-back", "unfit"]
    cause: str
    machine_ms: int
    said: str


@dataclass(frozen=True, kw_only=True)
class Fail(Command[Literal["failed", "lost"]]):
    """Fail a job whose scene cannot be rendered."""

    job: str
    entry: str
    worker: str
    index: int
    reason: str
    machine_ms: int
    said: str
