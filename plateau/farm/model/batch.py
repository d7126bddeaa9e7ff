"""A batch as its users see it: the progress of its jobs."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from pydantic import Field

from plateau.farm.model.record import Record
from plateau.farm.model.shot import Shot
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState


class Extent(Record):
    """The range of a value over several jobs."""

    least: float
    most: float
    mean: float


class Batch(Record):
    """Many jobs under one name."""

    name: str
    jobs: int = Field(description="how many it has")
    job_ids: list[str] = Field(description="in the order in which they were made")
    states: dict[JobState, int] = Field(description="how many are in each state that any is in")
    held: int = Field(description="how many of the queued jobs are held until the batch is resumed")
    finished: int = Field(description="how many have ended and have their results written")
    spp: Extent | None = Field(None, description="spp merged, of all jobs")
    estimate_fraction: Extent | None = Field(
        None, description="noise left, of the jobs that have an estimate"
    )
    machine_s: float = Field(description="seconds that render children spent on it")
    samples_saved: int = Field(description="the sum of `samples_saved` of its jobs")
    created_at: datetime = Field(description="when its first job was made")
    started_at: datetime | None = Field(None, description="when the first slice was leased")
    ended_at: datetime | None = Field(None, description="when its last job ended, once all have")
    forecast_end_at: datetime | None = Field(
        None,
        description="when its last job will end, at the batch's mean rate so far; null while that "
        "cannot be said",
    )
    shot: Shot | None = Field(None, description="its newest shot, if it is one")


@dataclass(frozen=True, kw_only=True)
class Member:
    """The facts of a job that a summary needs."""

    id: str
    spec: JobSpec  #: without the job's own parameters
    state: JobState
    held: bool
    spp: int
    committed_spp: int
    estimate_fraction: float | None
    expected_spp: int | None
    shot: str | None = None  #: of which it is a frame
    machine_s: float
    samples_saved: int
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None
    finished: bool


class BatchLine(Record):
    """A batch in a list of them."""

    name: str
    jobs: int = Field(description="how many it has")
    states: dict[JobState, int] = Field(description="how many are in each state that any is in")
    newest_at: datetime = Field(description="when its newest job was made")


class SteeredJob(Record):
    """The result of steering one job of a batch."""

    job: str = Field(description="its id")
    done: bool = Field(description="whether it is so now; perhaps it was before")
    state: JobState | None = Field(None, description="its state; null where the job was left alone")
    why_not: str | None = Field(None, description="why it was not done")


def summarise(
    name: str, members: list[Member], *, now: datetime, shot: Shot | None = None
) -> Batch:
    """The batch of these jobs, at least one, in the order in which they were made."""
    ended = [member.ended_at for member in members if member.ended_at is not None]
    started = [member.started_at for member in members if member.started_at is not None]
    return Batch(
        name=name,
        jobs=len(members),
        job_ids=[member.id for member in members],
        states=Counter(member.state for member in members),
        held=sum(member.held for member in members),
        finished=sum(member.finished for member in members),
        spp=_extent(member.spp for member in members),
        estimate_fraction=_extent(member.estimate_fraction for member in members),
        machine_s=round(sum(member.machine_s for member in members), 3),
        samples_saved=sum(member.samples_saved for member in members),
        created_at=members[0].created_at,
        started_at=min(started, default=None),
        ended_at=max(ended) if len(ended) == len(members) else None,
        forecast_end_at=_forecast(members, now),
        shot=shot,
    )


def _extent(values: Iterable[float | None]) -> Extent | None:
    found = [value for value in values if value is not None]
    if not found:
        return None
    return Extent(least=min(found), most=max(found), mean=sum(found) / len(found))


def _forecast(members: list[Member], now: datetime) -> datetime | None:
    """When the last job will end, at the farm's mean rate while it worked on the batch.

    A job ends where its newest point expects it to, or at its cap where that comes first; where
    nobody knows, it is taken to need the mean spp of the converged jobs. None where a job's end is
    unknown, or a job waits for a person.
    """
    to_come = [member for member in members if not member.state.ended]
    if not to_come or any(one.held or one.state is JobState.PAUSED for one in to_come):
        return None
    machine_s = sum(member.machine_s for member in members)
    rendered = sum(member.committed_spp for member in members)
    busy_s = _busy_s(members, now)
    if not rendered or machine_s <= 0 or busy_s <= 0:
        return None
    needed = [one.spp for one in members if one.state is JobState.CONVERGED]
    usual = sum(needed) / len(needed) if needed else None
    remaining_s = 0.0
    for member in to_come:
        last = _last_spp(member, usual)
        if last is None:
            return None
        s_per_spp = machine_s / rendered
        if member.committed_spp:
            s_per_spp = member.machine_s / member.committed_spp
        remaining_s += max(0.0, last - member.committed_spp) * s_per_spp
    return now + timedelta(seconds=round(remaining_s * busy_s / machine_s, 3))


def _last_spp(member: Member, usual: float | None) -> float | None:
    spec = member.spec
    last: float | None = member.expected_spp
    if last is None:  # without a point
        last = spec.rule.behaviour.expected_end_spp(None)
    if last is None and usual is not None and usual > member.spp:
        last = max(usual, spec.min_spp or 0)
    return None if last is None else min(last, spec.max_spp)


def _busy_s(members: list[Member], now: datetime) -> float:
    """Seconds in which any job of the batch was being rendered."""
    times = sorted(
        (one.started_at, one.ended_at or now) for one in members if one.started_at is not None
    )
    busy, until = timedelta(), None
    for start, end in times:
        if until is None or start > until:
            busy, until = busy + (end - start), end
        elif end > until:
            busy, until = busy + (end - until), end
    return busy.total_seconds()
