"""Commands of workers for the queue: they lease slices, and commit them or give them back."""

from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command, Reply

#: ``duplicate``: the ledger has another try of the slice, and the partial can go. ``stale``: after
#: a long pause without commits, others render with another variant. ``overlap``: another slice in
#: the ledger has its seeds, which is a bug, and refused.
CommitEnd = Literal["committed", "duplicate", "ended", "stale", "overlap"]


@dataclass(frozen=True, kw_only=True)
class LeasedSlice:
    """A slice, and the data to render it."""

    job: str
    entry: str  #: of the job's stream
    index: int
    tries: int  #: the number of its leases, this one included
    variant: str
    spec: str  #: JSON
    scene: str  #: its SHA-256
    round: str | None = None  #: JSON of a `slices.rounds.Round`; None for a whole film


@dataclass(frozen=True, kw_only=True)
class Offer:
    """The answer to a worker that asks for a slice."""

    slice: LeasedSlice | None = None
    again: bool = False  #: the slice that was found needs no rendering: ask again
    wait_ms: float | None = None  #: without a slice: until another worker's may be late


class Lease(Command[Offer]):
    """Ask for the next slice."""

    worker: str
    kind: str  #: `plateau.farm.model.fit.WorkerClass`
    loaded: str  #: the job whose scene it has loaded, or ""
    in_turn: bool  #: whether its turn with that job lasts
    lease_ms: int
    most_tries: int


class LeaseCommand(Command[Reply]):
    """A command about a leased slice."""

    job: str
    entry: str
    worker: str


class TryCommand(LeaseCommand[Reply]):
    """A command that ends a try of a slice."""

    index: int
    machine_ms: int
    threads: int  #: of the render child
    said: str  #: the render child's output


class Commit(TryCommand[CommitEnd]):
    """Enter a rendered slice into the ledger."""

    record: str  #: JSON of a `plateau.farm.ledger.queue.SliceRecord`
    width: int
    height: int
    notes: str  #: JSON
    variant: str


class Glimpse(LeaseCommand[Literal["noted", "lost", "late"]]):
    """Note the blob of the first pass of a job's first slice."""

    blob: str


class Died(TryCommand[Literal["put back", "poisoned", "lost"]]):
    """Report that a render child died on a slice."""

    cause: str
    most_tries: int
    alive_ms: int  #: a worker without a heartbeat for longer is dead


class HandBack(TryCommand[Literal["put back", "lost"]]):
    """Give a slice back that nobody died on."""

    what: Literal["handed-back", "unfit"]
    cause: str
    leaves_out: bool  #: whether the worker takes nothing of the job for a while


class Fail(TryCommand[Literal["failed", "lost"]]):
    """Fail a job whose scene cannot be rendered."""

    reason: str
