"""When each job of the queue will start: an estimate from the work before it.

A worker takes the job of the highest priority, then of the owner and the batch with the fewest
samples under way, then the oldest. At the end of its turn it still has a slice of its own job under
way, so that the oldest one without any is next. So of a priority one single job or batch more is
rendered by turns than there are workers, the oldest first; the jobs of a batch follow each other;
and a job of a lower priority starts when those above it are done. The estimate follows the same
order, takes all workers as equally fast, and shares them evenly. It is wrong where jobs are added,
steered or end sooner than forecast, and where workers come and go.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final

from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState

#: How long a worker keeps to its loaded scene before it looks who waits, in seconds.
TURN_S: Final = 20.0


@dataclass(frozen=True, kw_only=True)
class OpenJob:
    """A job that has not ended, as far as the queue goes by it."""

    id: str
    number: int  #: of creation
    priority: int
    owner: str = ""  #: an API key's id, or "" without one
    batch: str = ""
    workers: frozenset[str]  #: ids of the living ones that may render it
    leased: int = 0  #: slices under way
    left_s: float = 0.0  #: one worker's time for it until it ends
    is_capped: bool = False  #: whether that counts to its cap, for want of a forecast

    @property
    def party(self) -> str:
        """What it shares the workers as: its batch, or itself."""
        return f"batch {self.batch}" if self.batch else f"job {self.id}"


@dataclass(frozen=True)
class Start:
    """When a job will start."""

    seconds: float  #: from now
    is_bound: bool  #: whether jobs before it may end sooner, as they are counted to their caps


def why_unknown(job: Job, waits_for: str | None) -> str | None:
    """In words, why a job without an expected start has none; None where it is not queued.

    `waits_for` names the worker or the jobs that it waits for.
    """
    if job.state is not JobState.QUEUED:
        return None
    if job.held:
        return "is held back until it is resumed"
    return waits_for or "cannot be told: too many jobs are open, or its worker has just come"


def expected_start(
    job: OpenJob, queue: Iterable[OpenJob], slice_s: float, turn_s: float = TURN_S
) -> Start | None:
    """When the job's first slice will be taken; None if no worker may render it.

    Parameters
    ----------
    job
        One that is queued, and may start.
    queue
        All jobs that may be rendered, now or later; with the job or without.
    slice_s
        The mean time of a slice.
    turn_s
        How long a worker keeps to a scene.
    """
    return expected_starts([job], queue, slice_s, turn_s).get(job.id)


def expected_starts(
    jobs: Sequence[OpenJob], queue: Iterable[OpenJob], slice_s: float, turn_s: float = TURN_S
) -> dict[str, Start]:
    """As `expected_start`, for many jobs by their ids, without those that no worker may render."""
    every = {one.id: one for one in (*queue, *jobs)}
    among: defaultdict[frozenset[str], set[str]] = defaultdict(set)
    for job in jobs:
        among[job.workers].add(job.id)
    found: dict[str, Start] = {}
    for workers, wanted in among.items():
        if not workers:
            continue
        ahead = [one for one in every.values() if one.workers & workers]
        free_s = _free_after_s(ahead, workers, slice_s, turn_s)
        first_s = {at: turn_s if after is None else after for at, after in free_s.items()}
        later_s = (turn_s + slice_s) / len(workers)
        for one, start in _starts(ahead, workers, first_s, later_s):
            if one.id in wanted:
                least = free_s[one.priority] or 0.0
                found[one.id] = Start(max(start.seconds, least), start.is_bound)
    return found


def _free_after_s(
    jobs: Iterable[OpenJob], workers: frozenset[str], slice_s: float, turn_s: float
) -> dict[int, float | None]:
    """The expected time until a worker takes another job, for a job of each priority.

    None where a worker is free. All others are expected to be somewhere in their slices, and in
    their turns with a scene, which does not hold back a job of a higher priority.
    """
    leased: defaultdict[int, int] = defaultdict(int)
    first_end_s = turn_s + slice_s
    jobs = list(jobs)
    for one in jobs:
        leased[one.priority] += one.leased
        if one.leased:
            first_end_s = min(first_end_s, one.left_s / one.leased)
    busy = sum(leased.values())
    found: dict[int, float | None] = {}
    any_turn_ends_s = min(first_end_s, (turn_s + slice_s) / (len(workers) + 1))
    for priority in {one.priority for one in jobs}:
        below = sum(slices for at, slices in leased.items() if at < priority)
        if busy < len(workers):
            found[priority] = None
        elif below:
            found[priority] = min(slice_s / (below + 1), any_turn_ends_s)
        else:
            found[priority] = any_turn_ends_s
    return found


def _starts(
    jobs: Sequence[OpenJob], workers: frozenset[str], first_s: Mapping[int, float], later_s: float
) -> Iterator[tuple[OpenJob, Start]]:
    """Each job's start where all workers are equally fast, the first of them at once.

    At each priority, a turn of some worker's ends in `first_s`, and the next one `later_s` after a
    job has ended.
    """
    begun_s, capped = 0.0, False
    for priority in sorted({one.priority for one in jobs}, reverse=True):
        level = [one for one in jobs if one.priority == priority]
        started = [
            (one, begun_s + at)
            for one, at in _at_one_priority(level, workers, first_s[priority], later_s)
        ]
        started.sort(key=lambda start: start[1])
        bound_from = min((at for one, at in started if one.is_capped), default=None)
        for one, at in started:
            after = bound_from is not None and at > bound_from
            yield one, Start(at, at > 0 and (capped or after))
        begun_s += sum(_share_s(one, workers) for one in level) / len(workers)
        capped = capped or bound_from is not None


def _share_s(job: OpenJob, workers: frozenset[str]) -> float:
    """The part of the job's work that these workers will do: others may do their share."""
    return job.left_s * len(job.workers & workers) / len(job.workers)


def _at_one_priority(
    jobs: Iterable[OpenJob], workers: frozenset[str], first_s: float, later_s: float
) -> Iterator[tuple[OpenJob, float]]:
    """Each job and its start in seconds, where none of a higher priority is before it.

    One party more is rendered than there are workers, which they share evenly.
    """
    parties: defaultdict[tuple[str, str], list[OpenJob]] = defaultdict(list)
    for job in sorted(jobs, key=lambda job: job.number):
        parties[job.owner, job.party].append(job)
    waiting = [iter(parties[name]) for name in _in_turn(parties)][::-1]
    # The next to end comes first, by the time that each party has had to itself.
    running: list[tuple[float, int, Iterator[OpenJob]]] = []
    now_s, alone_s, entry = 0.0, 0.0, 0
    turn_s = first_s

    while waiting or running:
        party = waiting.pop() if waiting and len(running) <= len(workers) else None
        if party is None:
            ends_s, _, party = heappop(running)
            now_s += (ends_s - alone_s) * (len(running) + 1) / len(workers)
            alone_s, turn_s = ends_s, later_s
        one = next(party, None)
        if one is not None:
            has_worker = len(running) < len(workers)
            yield one, now_s + (0.0 if has_worker else min(turn_s, running[0][0] - alone_s))
            entry += 1
            heappush(running, (alone_s + _share_s(one, workers), entry, party))


def _in_turn(parties: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The parties by age, one of each owner in turn: more jobs bring no more workers."""
    owners: defaultdict[str, int] = defaultdict(int)
    placed = []
    for age, (owner, party) in enumerate(parties):
        placed.append((owners[owner], age, owner, party))
        owners[owner] += 1
    return [(owner, party) for _, _, owner, party in sorted(placed)]
