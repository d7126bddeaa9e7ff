"""Commands that create, continue, steer, end, delete and restore jobs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from plateau.farm.model.states import EndedBy
from plateau.farm.redis.commands.command import Command, Reply


@dataclass(frozen=True)
class NewJob:
    """The id of a new job, the fields of its hash, and of the one that workers cannot change."""

    id: str
    fields: Mapping[str, str | int]
    sealed: Mapping[str, str] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, kw_only=True)
class Made:
    """The answer to a request for new jobs."""

    outcome: Literal[
        "created",
        "repeated",
        "conflict",
        "changed",
        "missing",
        "too varied",
        "too many",
        "cannot follow",
    ]
    job: str = ""  #: the first, if created, repeated or in conflict
    has: int = 0  #: open jobs, or different needs, if too many
    most: int = 0  #: open jobs that are allowed
    after: str = ""  #: what cannot be followed: a name, or a job in words
    state: str = ""  #: and how it stands: ``missing``, ``deleted``, ``lost`` or a job's state


class CreationCommand(Command[Reply]):
    """A command that creates jobs."""

    idempotency: str  #: key, or ""
    digest: str  #: of the request
    priority: int


class Create(CreationCommand[Made]):
    """Create jobs, many of one batch or a single one; all or none."""

    jobs: tuple[NewJob, ...]
    after: tuple[str, ...]  #: jobs and batches that must have ended well before


@dataclass(frozen=True)
class DecidedRound:
    """A round that an image has decided."""

    first: int  #: index of its first slice
    json: str  #: of a `plateau.farm.model.slices.rounds.Round`


class Continue(CreationCommand[Made]):
    """Create a job that continues a finished one."""

    job: NewJob
    old: str  #: the finished one
    slices: int  #: its first slices, which are taken over
    checkpoint: str  #: JSON, of their sums; "" where the slices are kept
    judged_spp: int  #: the last point of the curve that is taken over
    samples: int  #: of the slices that are taken over
    rounds: tuple[DecidedRound, ...]  #: those that are taken over


Outcome = Literal["ended", "paused", "held", "rendering", "queued", "changed", "illegal", "fenced"]


@dataclass(frozen=True, kw_only=True)
class Moved:
    """The answer to a move of a job."""

    outcome: Outcome
    state: str = ""  #: if illegal, the state that forbids it, or ``missing``


class End(Command[Moved]):
    """End a job."""

    job: str
    target: str  #: the state at its end
    ended_by: EndedBy
    reason: str
    token: str | None = None  #: its owner's; None where a user ends it
    verdict: str | None = None  #: JSON: the numbers of the rule that fired
    results: str = ""  #: their blob prefix, if they are written
    digests: Mapping[str, str] | None = None  #: their SHA-256 by blob
    notes: str | None = None  #: JSON; None where they stay as they are


class Pause(Command[Moved]):
    """Pause a job that is rendering."""

    job: str
    reason: str
    holds_back: bool = False  #: hold back a queued one, too


class Resume(Command[Moved]):
    """Resume a paused job, or release one that is held back."""

    job: str
    reason: str


class Reprioritise(Command[Moved]):
    """Give a job another priority."""

    job: str
    priority: int


class SetDeleted(Command[Moved]):
    """Delete an ended job, or restore it."""

    job: str
    deleted: bool
