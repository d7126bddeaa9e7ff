"""Commands of a job's owner: a monitor, by the fencing token of its ownership."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from plateau.farm.redis.commands.command import Command, Items, Reply
from plateau.farm.redis.commands.jobs import DecidedRound


@dataclass(frozen=True)
class Ownership:
    """A job, and the token under which a monitor owns it."""

    job_id: str
    token: str


class Own(Command[str | None]):
    """Take a job that nobody owns; answers the token."""

    job: str
    lease_ms: int


class Renew(Command[Items[str]]):
    """Renew the ownership of jobs; answers those that were lost."""

    lease_ms: int
    owned: tuple[Ownership, ...]


class Disown(Command[None]):
    """Give jobs back."""

    owned: tuple[Ownership, ...]


class OwnerCommand(Command[Reply]):
    """A command of the owner's; another monitor gets the answer ``fenced``, or None."""

    job: str
    token: str


class Plan(OwnerCommand[Literal["planned", "fenced", "ended"]]):
    """Let the slices before this one be leased."""

    stop: int
    expected_spp: int | None  #: where the job is expected to end


class AppendPoint(OwnerCommand[Literal["appended", "known", "fenced"]]):
    """Append a point to the curve, and the round that its image decides."""

    spp: int
    point: str  #: JSON
    round: DecidedRound | None  #: if one is decided
    is_last: bool  #: whether no more samples are needed


class Reject(OwnerCommand[int | None]):
    """Have a slice rendered again; answers how often that has happened to it."""

    index: int
    blob: str
    cause: str


class Show(OwnerCommand[Literal["shown", "fenced"]]):
    """Show a set of results."""

    results: str  #: their blob prefix
    spp: int
    digests: Mapping[str, str] | None  #: their SHA-256 by blob


class NoteBlob(OwnerCommand[Literal["noted", "fenced"]]):
    """Note the digest of a blob of the job."""

    blob: str  #: without jobs/ID/
    sha256: str | None  #: None to forget it


class Save(OwnerCommand[Literal["saved", "fenced"]]):
    """Note the job's last checkpoint."""

    checkpoint: str  #: JSON
    waits: str | None  #: JSON of a `plateau.farm.model.shot.FrameWait`, if it does


class Conclude(OwnerCommand[Literal["concluded", "fenced"]]):
    """Note that the results of an ended job are written."""

    spp: int
    results: str  #: "" where it has none
    digests: Mapping[str, str] | None  #: None where they were shown before
    notes: str  #: JSON
    spp_range: tuple[int, int] | None  #: by zones, the least and the most of the final image


class Finish(OwnerCommand[Literal["finished", "fenced"]]):
    """Note that an ended job is cleared."""

    keeps_sums: bool


class Abandon(OwnerCommand[Literal["abandoned", "kept", "fenced"]]):
    """Note that Redis has lost the job."""
