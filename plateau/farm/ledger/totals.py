"""The whole farm's work, done and to do.

Totals only grow. The commands that end a job or commit a slice count it in the same step, so a
restart of any process loses nothing, and any process can answer for all. The work to do is counted
afresh over the open jobs.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from typing import Final

from plateau.farm.ledger import costs, records
from plateau.farm.ledger.workers import ALIVE_S
from plateau.farm.model.fit import class_of_worker, parts_of
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.renderers import AUTO
from plateau.farm.model.states import JobState
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.sweeps import NoteSweep
from plateau.farm.redis.scripts import Scripts

#: How tries of slices end: `plateau.farm.model.job.TryEnd`, ``late`` (rendered when the job had
#: ended) and ``lost`` (its worker fell silent).
TRY_ENDS: Final = (
    *("committed", "duplicate", "stale", "late", "handed-back"),
    *("unfit", "died", "lost", "failed", "rejected"),
)
#: The states at which jobs end.
ENDS: Final = tuple(state.value for state in JobState if state.ended)

#: How tries of notices end; after ``failed``, another try follows.
NOTICE_TRY_ENDS: Final = ("delivered", "failed", "given-up")

#: A guess of a slice's time, until the farm has rendered one.
_SLICE_MS: Final = 1000.0

#: What living workers do.
_WORKER_STATES: Final = ("idle", "rendering", "out_of_service")
#: The states of jobs that have not ended.
_OPEN: Final = ("queued", "rendering", "paused")
#: The fields of a job's hash that a count needs.
_FIELDS: Final = (
    *("state", "ready", "leased", "committed", "created_at", "held", "variant", "asked_variant"),
    *("machine_ms", "slice_spp", "expected_spp", "again", "need", "awaits", "number"),
)


@dataclass(frozen=True, kw_only=True)
class Demand:
    """Slices that need a worker, for an autoscaler."""

    waiting: int = 0  #: planned and not leased, without those of paused jobs
    leased: int = 0
    # Estimates, which do not count in comparisons.
    left: int = field(default=0, compare=False)  #: until the jobs end, planned or not
    #: Seconds of one worker for those, by the mean time of the jobs' slices so far.
    work_s: float = field(default=0.0, compare=False)

    @property
    def slices(self) -> int:
        """All slices: a worker is needed for each, leased or waiting."""
        return self.waiting + self.leased


@dataclass(frozen=True, kw_only=True)
class Census:
    """The farm at one moment."""

    jobs: dict[str, int]  #: that have not ended, by state
    #: Jobs without a suitable living worker that takes work, the oldest first.
    unserved: tuple[str, ...]
    queue_age_s: float  #: age of the oldest job without a rendered slice; 0 without one
    #: Of open jobs, by their class: variant ("auto" for any), pool, and tags with commas between.
    demand: dict[str, Demand]
    workers: dict[str, int]  #: alive: idle, rendering or out_of_service
    monitors: int  #: alive
    jobs_owned: int  #: by monitors that are alive
    jobs_ended: dict[str, int]  #: by the state at which they ended
    tries: dict[str, int]  #: of slices, by how they ended
    samples: int  #: in committed slices
    samples_saved: int  #: the sum of `plateau.farm.model.job.Job.samples_saved` over all jobs ever
    machine_s: float  #: of render children
    notices_waiting: int  #: for a try, or being tried
    notice_tries: dict[str, int]  #: by how they ended
    swept_at: float | None  #: when the last sweep ended, in s since 1970

    @property
    def slices(self) -> dict[str, int]:
        """Waiting and leased slices of open jobs."""
        demand = self.demand_for()
        return {"waiting": demand.waiting, "leased": demand.leased}

    def demand_for(
        self,
        variants: Collection[str] = (),
        *,
        pool: str | None = None,
        tags: Collection[str] | None = None,
    ) -> Demand:
        """The demand for workers of this pool that have one of these variants and these tags.

        An omitted argument matches any. A job that any variant suits counts for all.
        """

        def suits(needed: str) -> bool:
            variant, in_pool, required = parts_of(needed)
            return (
                (not variants or variant == AUTO or variant in variants)
                and pool in (None, in_pool)
                and (tags is None or required <= set(tags))
            )

        return _sum(demand for needed, demand in self.demand.items() if suits(needed))


def take_census(client: RedisClient) -> Census:
    """Count the farm."""
    pipe = client.pipeline(transaction=True)
    pipe.time()
    pipe.smembers(keys.UNFINISHED)  # those that have not ended, and a few more
    pipe.zrange(keys.WORKERS, 0, -1, withscores=True)
    pipe.zrange(keys.MONITORS, 0, -1, withscores=True)
    pipe.zrange(keys.NOTICES, 0, -1)
    pipe.hgetall(keys.TOTALS)
    (seconds, us), job_ids, seen, due, receivers, counted = pipe.execute()
    now_ms = int(seconds) * 1000 + int(us) / 1000
    workers = [worker for worker, at in seen if at >= now_ms - ALIVE_S * 1000]
    monitors = [monitor for monitor, overdue in due if overdue >= now_ms]
    pipe = client.pipeline(transaction=False)
    for worker in workers:
        pipe.hgetall(keys.worker(worker))
    for monitor in monitors:
        pipe.hget(keys.monitor(monitor), "jobs")
    for receiver in receivers:
        pipe.zcard(f"{keys.NOTICES}:{receiver}")
    for job_id in job_ids:
        pipe.hmget(keys.job(job_id), _FIELDS)
        pipe.zcard(keys.job(job_id, "lost"))
    answers = iter(pipe.execute())
    read = [records.worker(one, now_ms) for one in islice(answers, len(workers))]
    crew = list(filter(None, read))
    owned = sum(int(jobs or 0) for jobs in islice(answers, len(monitors)))
    notices = sum(islice(answers, len(receivers)))
    totals = {name: int(number) for name, number in counted.items()}
    usual_ms = _mean_slice_ms(totals)

    @cache
    def suited(wanted: str) -> list[Worker]:
        takes_work = (one for one in crew if one.trouble is None and not one.drained)
        return [one for one in takes_work if class_of_worker(one).serves(wanted)]

    states: Counter[str] = Counter(dict.fromkeys(_OPEN, 0))
    demand: dict[str, list[Demand]] = defaultdict(list)
    unserved: list[tuple[int, str]] = []
    oldest_ms = now_ms
    for job_id, values, lost in zip(job_ids, answers, answers, strict=True):
        job = dict(zip(_FIELDS, values, strict=True))
        if job["state"] not in _OPEN:
            continue
        states[job["state"]] += 1
        wanted = f"{job['variant'] or job['asked_variant'] or AUTO} {job['need'] or DEFAULT_POOL}"
        may_begin = job["state"] != "paused" and not job["held"] and not job["awaits"]
        with records.leaving_out_unreadable(), records.reading(job_id):
            if may_begin and all(job_id in one.left_out_of for one in suited(wanted)):
                unserved.append((int(job["number"]), job_id))
            if may_begin and job["committed"] == "0":
                oldest_ms = min(oldest_ms, float(job["created_at"]))
            waiting = int(job["ready"]) + lost if may_begin else 0
            demand[wanted].append(_demand(job, waiting, int(job["leased"]) - lost, usual_ms))
    return Census(
        jobs=dict(states),
        unserved=tuple(job_id for _, job_id in sorted(unserved)),
        queue_age_s=(now_ms - oldest_ms) / 1000,
        demand={wanted: _sum(demands) for wanted, demands in demand.items()},
        workers={state: [*map(_state, crew)].count(state) for state in _WORKER_STATES},
        monitors=len(monitors),
        jobs_owned=owned,
        jobs_ended={state: totals.get(f"ended {state}", 0) for state in ENDS},
        tries={end: totals.get(f"tries {end}", 0) for end in TRY_ENDS},
        samples=totals.get("samples", 0),
        samples_saved=totals.get("samples saved", 0),
        machine_s=totals.get("machine ms", 0) / 1000,
        notices_waiting=notices,
        notice_tries={end: totals.get(f"notice tries {end}", 0) for end in NOTICE_TRY_ENDS},
        swept_at=totals["swept at"] / 1000 if "swept at" in totals else None,
    )


def _state(worker: Worker) -> str:
    if worker.trouble is not None:
        return "out_of_service"
    return "idle" if worker.job is None else "rendering"


def _demand(job: Mapping[str, str], waiting: int, leased: int, usual_ms: float) -> Demand:
    """A job's slices, up to the end that its monitor expects, and one worker's time for them."""
    slice_spp, committed = int(job["slice_spp"]), int(job["committed"])
    left = float(leased)  # more workers would be of no use
    if waiting:
        left = max(waiting + leased, int(job["expected_spp"] or 0) / slice_spp - committed)
    measured = committed - costs.kept_spp(job) / slice_spp
    slice_ms = int(job["machine_ms"]) / measured if measured > 0 else usual_ms
    return Demand(
        waiting=waiting, leased=leased, left=math.ceil(left), work_s=left * slice_ms / 1000
    )


def _sum(demands: Iterable[Demand]) -> Demand:
    asked = tuple(demands)
    return Demand(
        waiting=sum(one.waiting for one in asked),
        leased=sum(one.leased for one in asked),
        left=sum(one.left for one in asked),
        work_s=sum(one.work_s for one in asked),
    )


def _mean_slice_ms(totals: dict[str, int]) -> float:
    """The mean time of all slices: an estimate for jobs without a rendered slice."""
    committed = totals.get("tries committed", 0)
    return totals.get("machine ms", 0) / committed if committed else _SLICE_MS


def note_sweep(client: RedisClient) -> None:
    """Note that a sweep has just ended."""
    Scripts(client).run(NoteSweep())
