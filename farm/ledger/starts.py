"""Reads the queue, and tells of its jobs when each will start."""

from __future__ import annotations

import json
import threading
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from plateau.farm.ledger import records
from plateau.farm.ledger.workers import ALIVE_S
from plateau.farm.model.fit import ANY, meets
from plateau.farm.model.job import Job
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.starts import OpenJob, Start, expected_starts
from plateau.farm.model.states import JobState
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.redis.client import Pipeline, RedisClient
from plateau.farm.redis.link import unavailable_as_farm_error

#: Beyond so many open jobs nothing is said, as reading them would cost too much.
MOST_OPEN: Final = 5000
#: How long what was read is used again: many people look at one list.
_FRESH_S: Final = 2.0
#: A guess of a slice's time, until the farm has rendered one.
_SLICE_S: Final = 1.0

_FIELDS: Final = (
    *("number", "state", "held", "awaits", "leased", "committed", "committed_samples", "width"),
    *("height", "slice_spp", "max_spp", "end_spp", "machine_ms", "continued_spp", "latest"),
    *("variant", "asked_variant", "need", "party", "batch", "scene_sha256"),
)


@dataclass(frozen=True)
class _Row:
    """A job as it was read: its work is known in slices, and maybe in seconds."""

    job: OpenJob
    scene: str
    slices_left: float
    slice_s: float | None  #: the mean of its own slices
    stands: bool  #: whether it will not be rendered until something happens to it


@dataclass(frozen=True)
class _Queue:
    """The open jobs at one moment, each with an estimate of its work."""

    jobs: dict[str, OpenJob]
    slice_s: float  #: the mean of those under way
    is_whole: bool  #: whether all open jobs are there
    read_at: float = field(default_factory=time.monotonic)

    def has(self, jobs: Iterable[str]) -> bool:
        """Whether it has these jobs, as far as it has any."""
        return not self.is_whole or all(one in self.jobs for one in jobs)


class Starts:
    """Tells when jobs will start. Raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._queue: _Queue | None = None
        self._reading = threading.Lock()

    def of(self, jobs: Iterable[Job]) -> dict[str, Start | None]:
        """The starts of those of the jobs that are queued and may be rendered, by their ids.

        None where more jobs are open than are looked at, and where no worker fits.
        """
        asked = [job.id for job in jobs if _may_start(job)]
        if not asked:
            return {}
        queue = self._newest(asked)
        wanted = [queue.jobs[one] for one in asked if one in queue.jobs]
        starts = expected_starts(wanted, queue.jobs.values(), queue.slice_s)
        return {one: starts.get(one) if queue.is_whole else None for one in asked}

    def _newest(self, asked: Sequence[str]) -> _Queue:
        """What was read last, or what is read now if that is old or lacks a job."""
        with self._reading:
            queue = self._queue
            is_old = queue is None or time.monotonic() > queue.read_at + _FRESH_S
            if queue is None or is_old or not queue.has(asked):
                queue = self._queue = _read(self._redis)
            return queue


def unserved(client: RedisClient) -> list[str]:
    """The ids of the jobs that no living worker may render, the oldest first."""
    waiting = (job for job in _read(client).jobs.values() if not job.workers)
    return [job.id for job in sorted(waiting, key=lambda job: job.number)]


def _may_start(job: Job) -> bool:
    return job.state is JobState.QUEUED and not (job.held or job.awaits or job.awaits_turn)


def _read(client: RedisClient) -> _Queue:
    """The queue, in two round trips."""
    with unavailable_as_farm_error():
        pipe = client.pipeline(transaction=False)
        pipe.time()
        pipe.zrange(keys.WORKERS, 0, -1, withscores=True)
        pipe.zrange(keys.OPEN, 0, MOST_OPEN, withscores=True)
        pipe.hmget(keys.TOTALS, ("machine ms", "tries committed"))
        (seconds, _), alive, opened, (machine_ms, committed) = pipe.execute()
        if len(opened) > MOST_OPEN:
            return _Queue({}, _SLICE_S, is_whole=False)
        since = (int(seconds) - ALIVE_S) * 1000
        workers = [worker for worker, seen_at in alive if seen_at >= since]
        _ask(pipe, workers, [job for job, _ in opened])
        answers = pipe.execute()
        named = {
            job: dict(zip(_FIELDS, values, strict=True))
            for (job, _), values in zip(opened, answers[len(workers) :], strict=True)
        }
        _add_caps(client, named)
    living = [records.worker(fields) for fields in answers[: len(workers)] if fields]
    usual_s = int(machine_ms or 0) / int(committed) / 1000 if committed else _SLICE_S
    rows = []
    fitting: dict[tuple[str, str], frozenset[str]] = {}
    for job, priority in opened:
        with records.leaving_out_unreadable(), records.reading(job):
            row = _row(job, int(priority), named[job], living, fitting)
            if not row.stands:
                rows.append(row)
    return _with_work(rows, usual_s)


def _ask(pipe: Pipeline, workers: Iterable[str], jobs: Iterable[str]) -> None:
    for worker in workers:
        pipe.hgetall(keys.worker(worker))
    for job in jobs:
        pipe.hmget(keys.job(job), _FIELDS)


def _add_caps(client: RedisClient, jobs: dict[str, dict[str, str | None]]) -> None:
    """Read the caps of jobs of an older Plateau, which have them in their specs alone."""
    older = [job for job, fields in jobs.items() if not fields["max_spp"] and fields["state"]]
    pipe = client.pipeline(transaction=False)
    for job in older:
        pipe.hget(keys.job(job), "spec")
    for job, spec in zip(older, pipe.execute(), strict=True):
        with records.leaving_out_unreadable(), records.reading(job):
            jobs[job]["max_spp"] = json.loads(spec)["max_spp"]


def _row(
    job: str,
    priority: int,
    fields: dict[str, str | None],
    workers: Sequence[Worker],
    fitting: dict[tuple[str, str], frozenset[str]],
) -> _Row:
    """A job by its fields; `fitting` keeps the workers of each kind of job."""
    kind = (
        fields["variant"] or fields["asked_variant"] or ANY,
        fields["need"] or DEFAULT_POOL,
    )
    if kind not in fitting:
        fitting[kind] = frozenset(one.id for one in workers if meets(one, *kind))
    slice_spp = int(fields["slice_spp"] or 1)
    done_spp = records.committed_spp(fields, slice_spp)
    measured = done_spp - int(fields["continued_spp"] or 0)
    cap_spp = int(fields["max_spp"] or 0)
    expected_spp = json.loads(fields["latest"] or "{}").get("expected_spp") or fields["end_spp"]
    end_spp = cap_spp if expected_spp is None else min(cap_spp, int(expected_spp))
    leased = int(fields["leased"] or 0)
    return _Row(
        OpenJob(
            id=job,
            number=int(fields["number"] or 0),
            priority=priority,
            owner=fields["party"] or "",
            batch=fields["batch"] or "",
            workers=fitting[kind],
            leased=leased,
            is_capped=expected_spp is None,
        ),
        fields["scene_sha256"] or "",
        slices_left=max(leased, (end_spp - done_spp) / slice_spp),
        slice_s=int(fields["machine_ms"] or 0) / 1000 * slice_spp / measured
        if measured > 0
        else None,
        stands=fields["state"] not in {"queued", "rendering"}
        or bool(fields["held"] or fields["awaits"]),
    )


def _with_work(rows: Sequence[_Row], usual_s: float) -> _Queue:
    """The queue, where a job without a slice has those of others of its scene, or the farm's."""
    known: defaultdict[str, list[float]] = defaultdict(list)
    under_way = []
    for row in rows:
        if row.slice_s is not None:
            known[row.scene].append(row.slice_s)
            under_way += [row.slice_s] * row.job.leased
    of_scene = {scene: sum(times) / len(times) for scene, times in known.items()}
    jobs = (
        replace(
            row.job,
            left_s=row.slices_left * (row.slice_s or of_scene.get(row.scene, usual_s)),
        )
        for row in rows
    )
    slice_s = sum(under_way) / len(under_way) if under_way else usual_s
    return _Queue({job.id: job for job in jobs}, slice_s, is_whole=True)
