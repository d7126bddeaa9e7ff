"""What the whole farm has done and has to do: counted in Redis, read in one round trip.

Totals only grow. The scripts that end a job or commit a slice count it in the same atomic step, and
monitors report what they did, so a restart of any process loses nothing, and any process can answer
for all. What there is to do now is counted afresh over the jobs that have not ended.
"""

import json
import os
import socket
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Final

import redis

from farm import keys
from farm.durations import Durations, Histogram, histogram
from farm.redis_link import now_ms, unavailable_as_farm_error
from farm.scripts import Scripts
from farm.states import JobState

#: How tries of slices end, as the totals have them: as in a job's log (`farm.job.TryEnd`), and
#: ``late`` (rendered when the job had ended) and ``lost`` (its worker fell silent).
TRY_ENDS: Final = (
    "committed",
    "duplicate",
    "stale",
    "late",
    "handed-back",
    "unfit",
    "died",
    "lost",
    "failed",
    "rejected",
)
#: The states at which jobs end.
ENDS: Final = tuple(state.value for state in JobState if state.ended)

#: How tries of deliveries of webhooks end: after ``failed``, another follows.
DELIVERY_TRY_ENDS: Final = ("delivered", "failed", "given-up")

MERGE_BOUNDS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
EVALUATION_BOUNDS_S: Final = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 60.0)


@dataclass(frozen=True, kw_only=True)
class Census:
    """The farm at one moment."""

    jobs: dict[str, int]  #: that have not ended, by state
    jobs_stored: int  #: whatever their state
    queue_age_s: float  #: since the oldest was created of which nothing is rendered; 0 without one
    slices: dict[str, int]  #: of open jobs: waiting for a worker, and leased
    workers: dict[str, int]  #: alive: idle, rendering or out_of_service
    monitors: int  #: alive
    jobs_owned: int  #: by monitors that are alive
    jobs_created: int
    jobs_ended: dict[str, int]  #: by the state at which they ended
    tries: dict[str, int]  #: of slices, by how they ended
    samples: int  #: in slices that were committed
    samples_saved: int  #: that converged jobs did not need of their caps
    machine_s: float  #: that render children spent
    merges: Histogram  #: of one slice, its fetch included
    evaluations: Histogram  #: of a merged image by all rules of its job
    webhooks_waiting: int  #: messages that wait for a try, or are being tried
    webhook_tries: dict[str, int]  #: by how they ended
    webhooks_dropped: int  #: messages that were forgotten before they could be delivered
    swept_at: float | None  #: when a sweep was last done, in s since 1970


def take_census(scripts: Scripts, within_s: float = 15.0) -> Census:
    """Count the farm; workers that were not heard of for `within_s` are left out."""
    found = json.loads(scripts.run("census", round(within_s * 1000)))
    pairs = iter(found["totals"])
    totals = {name: int(number) for name, number in zip(pairs, pairs, strict=True)}
    oldest = found.get("oldest")
    return Census(
        jobs=found["jobs"],
        jobs_stored=found["stored"],
        queue_age_s=0.0 if oldest is None else (float(found["now"]) - float(oldest)) / 1000,
        slices=found["slices"],
        workers=found["workers"],
        monitors=found["monitors"],
        jobs_owned=found["owned"],
        jobs_created=int(found["created"]),
        jobs_ended={state: totals.get(f"ended {state}", 0) for state in ENDS},
        tries={end: totals.get(f"tries {end}", 0) for end in TRY_ENDS},
        samples=totals.get("samples", 0),
        samples_saved=totals.get("samples saved", 0),
        machine_s=totals.get("machine ms", 0) / 1000,
        merges=histogram(totals, "merge", MERGE_BOUNDS_S),
        evaluations=histogram(totals, "evaluation", EVALUATION_BOUNDS_S),
        webhooks_waiting=found["webhooks"],
        webhook_tries={end: totals.get(f"webhook tries {end}", 0) for end in DELIVERY_TRY_ENDS},
        webhooks_dropped=totals.get("webhooks dropped", 0),
        swept_at=totals["swept at"] / 1000 if "swept at" in totals else None,
    )


class MonitorWork:
    """What one monitor has done since it started, and its heartbeat that reports it.

    A monitor counts as alive for the length of a lease after its last heartbeat. One that is killed
    takes with it what it has done since then.
    """

    def __init__(self, client: redis.Redis, monitor_id: str, lease_s: float) -> None:
        self.merges = Durations(MERGE_BOUNDS_S)
        self.evaluations = Durations(EVALUATION_BOUNDS_S)
        self._scripts = Scripts(client)
        self._id = monitor_id
        self._lease_ms = round(lease_s * 1000)
        self._started_at = datetime.now(timezone.utc)

    def heartbeat(self, jobs: int) -> None:
        """Say that the monitor is alive, owns so many jobs, and has done this much."""
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
        self._report("")

    def _report(self, about: str) -> None:
        done = self.merges.numbers("merge") | self.evaluations.numbers("evaluation")
        flat = [item for pair in done.items() for item in pair]
        self._scripts.run("monitor_heartbeat", self._id, about, self._lease_ms, *flat)


def note_sweep(client: redis.Redis) -> None:
    """Note that a sweep was done just now."""
    with unavailable_as_farm_error():
        client.hset(keys.TOTALS, "swept at", now_ms(client))
