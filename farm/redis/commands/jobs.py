"""Jobs are created, gone on with, steered and ended."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True)
class NewJob:
    """A job to be created: its id, and the fields of its hash."""

    id: str
    fields: Mapping[str, str | int]


@dataclass(frozen=True, kw_only=True)
class Made:
    """How a request for new jobs went."""

    outcome: Literal[
        "created", "repeated", "conflict", "changed", "missing", "too varied", "too many"
    ]
    job: str = ""  #: the first, where it is created, repeated or in conflict
    has: int = 0  #: how many open jobs, or different needs, there are where these are too many
    most: int = 0  #: how many open jobs there may be


@dataclass(frozen=True, kw_only=True)
class Create(Command[Made]):
    """Create jobs, all of one batch where they are many; all or none."""

    idempotency: str  #: key, or ""
    digest: str  #: of the request
    priority: int
    batch: str  #: or ""
    guarded: bool  #: whether all jobs of the batch have to stop alike
    compared: str  #: number of the batch's newest job that they were compared with, or ""
    jobs: tuple[NewJob, ...]


@dataclass(frozen=True, kw_only=True)
class Continue(Command[Made]):
    """Create a job that goes on with a finished one; other fields are as in `Create`."""

    job: NewJob
    old: str  #: the finished one
    slices: int  #: its first ones, which are taken over
    checkpoint: str  #: JSON, of their sums; "" where the slices are kept
    judged_spp: int  #: the last of the curve that is taken over
    idempotency: str
    digest: str
    priority: int
    batch: str
    guarded: bool
    compared: str


Outcome = Literal["ended", "paused", "held", "rendering", "queued", "changed", "illegal", "fenced"]


@dataclass(frozen=True, kw_only=True)
class Moved:
    """What became of a job that was to be moved."""

    outcome: Outcome
    state: str = ""  #: the one that forbids it, or ``missing``, where it is illegal


@dataclass(frozen=True, kw_only=True)
class End(Command[Moved]):
    """End a job."""

    job: str
    target: str  #: the state that it comes to
    reason: str
    token: str | None = None  #: its owner's; None where a user ends it
    verdict: str | None = None  #: JSON: the numbers of the rule that fired
    results: str = ""  #: where they lie, if they are written
    digests: Mapping[str, str] | None = None  #: their SHA-256 by blob
    notes: str | None = None  #: JSON; None where they stay as they are


@dataclass(frozen=True, kw_only=True)
class Pause(Command[Moved]):
    """Pause a job that is rendering."""

    job: str
    reason: str
    holds_back: bool = False  #: also one that is queued


@dataclass(frozen=True, kw_only=True)
class Resume(Command[Moved]):
    """Let a paused job go on, or one that is held back begin."""

    job: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Reprioritise(Command[Moved]):
    """Give a job another priority."""

    job: str
    priority: int
