"""The whole farm's work, done and to do: counted in Redis, read in one round trip.

Totals only grow. The commands that end a job or commit a slice count it in the same step, and
monitors report their work, so a restart of any process loses nothing, and any process can answer
for all. The work to do is counted afresh over the open jobs.
"""

import json
import math
import os
import socket
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Final

from plateau.farm.model.durations import Durations, Histogram, histogram
from plateau.farm.model.fit import ANY
from plateau.farm.model.states import JobState
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands import census as commands
from plateau.farm.redis.commands.members import MonitorHeartbeat
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

MERGE_BOUNDS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
EVALUATION_BOUNDS_S: Final = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 60.0)


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
    jobs_stored: int  #: whatever their state
    #: Jobs without a suitable living worker that takes work, the oldest first.
    unserved: tuple[str, ...]
    queue_age_s: float  #: age of the oldest job without a rendered slice; 0 without one
    #: Of open jobs, by their class: variant ("auto" for any), pool, and tags with commas between.
    demand: dict[str, Demand]
    workers: dict[str, int]  #: alive: idle, rendering or out_of_service
    monitors: int  #: alive
    jobs_owned: int  #: by monitors that are alive
    jobs_created: int
    jobs_ended: dict[str, int]  #: by the state at which they ended
    tries: dict[str, int]  #: of slices, by how they ended
    samples: int  #: in committed slices
    samples_saved: int  #: the sum of `plateau.farm.model.job.Job.samples_saved` over all jobs ever
    second_tries: int  #: of slices that were late
    machine_s: float  #: of render children
    wasted_s: float  #: of those on tries of slices of which another was committed first
    merges: Histogram  #: of one slice, its fetch included
    evaluations: Histogram  #: of a merged image by all rules of its job
    notices_waiting: int  #: for a try, or being tried
    notice_tries: dict[str, int]  #: by how they ended
    swept_at: float | None  #: when the last sweep ended, in s since 1970

    @property
    def slices(self) -> dict[str, int]:
        """Waiting and leased slices of open jobs."""
        demand = self.demand_for()
        return {"waiting": demand.waiting, "leased": demand.leased}

    def demand_by_variant(self) -> dict[str, Demand]:
        """The demand in all pools, by the jobs' variant, "auto" for any."""
        by_variant: dict[str, list[Demand]] = {}
        for needed, demand in self.demand.items():
            by_variant.setdefault(needed.partition(" ")[0], []).append(demand)
        return {variant: _sum(demands) for variant, demands in by_variant.items()}

    def demand_for(
        self,
        variants: Collection[str] = (),
        *,
        pool: str | None = None,
        tags: Collection[str] | None = None,
    ) -> Demand:
        """The demand for workers of this pool that have one of these variants and these tags.

        An omitted argument matches any. A job that any variant suits counts for all: the first
        lease pins it to one.
        """

        def suits(needed: str) -> bool:
            variant, in_pool, *required = needed.split(" ")
            return (
                (not variants or variant == ANY or variant in variants)
                and pool in (None, in_pool)
                and (tags is None or set(",".join(required).split(",")) <= {*tags, ""})
            )

        return _sum(demand for needed, demand in self.demand.items() if suits(needed))


def take_census(
    client: RedisClient, within_s: float = 15.0, *, from_priority: int | None = None
) -> Census:
    """Count the farm; workers without a heartbeat for `within_s` are left out.

    Jobs of a priority below `from_priority` are counted, but are no demand.
    """
    found = Scripts(client).run(
        commands.Census(alive_ms=round(within_s * 1000), least_priority=from_priority)
    )
    totals, oldest = found.totals, found.oldest
    return Census(
        jobs=found.jobs,
        jobs_stored=found.stored,
        unserved=found.unserved,
        queue_age_s=0.0 if oldest is None else (float(found.now) - float(oldest)) / 1000,
        demand={
            needed: _demand(work, _mean_slice_ms(totals)) for needed, work in found.demand.items()
        },
        workers=found.workers,
        monitors=found.monitors,
        jobs_owned=found.owned,
        jobs_created=found.created,
        jobs_ended={state: totals.get(f"ended {state}", 0) for state in ENDS},
        tries={end: totals.get(f"tries {end}", 0) for end in TRY_ENDS},
        samples=totals.get("samples", 0),
        samples_saved=totals.get("samples saved", 0),
        second_tries=totals.get("second tries", 0),
        machine_s=totals.get("machine ms", 0) / 1000,
        wasted_s=totals.get("wasted ms", 0) / 1000,
        merges=histogram(totals, "merge", MERGE_BOUNDS_S),
        evaluations=histogram(totals, "evaluation", EVALUATION_BOUNDS_S),
        notices_waiting=found.notices,
        notice_tries={end: totals.get(f"notice tries {end}", 0) for end in NOTICE_TRY_ENDS},
        swept_at=totals["swept at"] / 1000 if "swept at" in totals else None,
    )


def _demand(work: commands.Work, unmeasured_ms: float) -> Demand:
    return Demand(
        waiting=work.waiting,
        leased=work.leased,
        left=math.ceil(work.left),
        work_s=(work.work_ms + work.unmeasured * unmeasured_ms) / 1000,
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


class MonitorWork:
    """One monitor's work since its start, and the heartbeat that reports it.

    A monitor counts as alive for the length of a lease after its last heartbeat. A killed monitor's
    work since then is not counted.
    """

    def __init__(self, client: RedisClient, monitor_id: str, lease_s: float) -> None:
        self.merges = Durations(MERGE_BOUNDS_S)
        self.evaluations = Durations(EVALUATION_BOUNDS_S)
        self._scripts = Scripts(client)
        self._id = monitor_id
        self._lease_ms = round(lease_s * 1000)
        self._started_at = datetime.now(timezone.utc)

    def heartbeat(self, jobs: int) -> None:
        """Report that the monitor lives, its number of jobs, and its work."""
        about = {
            "id": self._id,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "jobs": jobs,
            "started_at": self._started_at.isoformat(),
        }
        self._report(json.dumps(about))

    def sign_off(self) -> None:
        """Report for the last time."""
        self._report(None)

    def _report(self, about: str | None) -> None:
        done = self.merges.numbers("merge") | self.evaluations.numbers("evaluation")
        self._scripts.run(
            MonitorHeartbeat(monitor=self._id, about=about, life_ms=self._lease_ms, done=done)
        )


def note_sweep(client: RedisClient) -> None:
    """Note that a sweep has just ended."""
    Scripts(client).run(NoteSweep())
