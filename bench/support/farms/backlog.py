"""Slices that were committed while the monitors were stopped, and how fast these merge them."""

from __future__ import annotations

import hashlib
import signal
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import count
from typing import TYPE_CHECKING

from bench.support.farms.scale_farm import SPEC
from bench.support.farms.simulated import about, made_up_partial, made_up_record
from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.redis import keys

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.support.farms.scale_farm import ControlPlane

_VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
#: How many threads commit, so that they share Redis's waits for its disk.
_HANDS = 16
_LEASE_S = 600.0


@dataclass(frozen=True, kw_only=True)
class Merged:
    """What monitors did with a backlog, until half of it was merged."""

    rate: float  #: slices in a second
    ready_rate: float  #: the same, without the time in which a monitor waited for a core
    cpu_us: float  #: of all monitors, of a slice
    redis_us: float  #: of Redis, of a slice
    round_trips: float  #: reads of Redis's sockets, of a slice


def merged_backlog(farm: ControlPlane, *, jobs: int, slices: int, size: int) -> Merged:
    """Commit so many slices to so many jobs while the monitors are stopped; let these merge them.

    The control plane has a lease that is longer than this takes.
    """
    made = [farm.add_job() for _ in range(jobs)]
    started_at = datetime.now(timezone.utc).isoformat()
    for number in range(slices):  # a job is planned for all who could render it
        worker = f"worker-{number}"
        SliceQueue(farm.client, worker, _LEASE_S).heartbeat(
            about(worker, _VARIANTS, started_at), ()
        )
    farm.wait(lambda: all(farm.planned(job_id) >= slices for job_id in made))
    farm.signal_monitors(signal.SIGSTOP)
    _commit(farm, made, slices, size)

    def merged() -> float:
        pipe = farm.client.pipeline(transaction=False)
        for job_id in made:
            pipe.hget(keys.job(job_id), "spp")
        return sum(map(int, pipe.execute())) / SPEC.slice_spp

    began, already, before = farm.sample(), merged(), farm.delay_s()
    farm.signal_monitors(signal.SIGCONT)
    farm.wait(lambda: merged() - already >= jobs * slices / 2)
    spent, done, delay_s = farm.sample().since(began), merged() - already, farm.delay_s() - before
    return Merged(
        rate=done / spent.at,
        ready_rate=done / (spent.at - delay_s),
        cpu_us=1e6 * spent.monitors_cpu_s / done,
        redis_us=1e6 * spent.redis_cpu_s / done,
        round_trips=spent.reads / done,
    )


def _commit(farm: ControlPlane, jobs: Sequence[str], slices: int, size: int) -> None:
    """Commit so many slices of each job, in turns."""
    content = made_up_partial(width=size, height=size, spp=SPEC.slice_spp, variant=_VARIANTS[0])
    sha256, store, numbers = hashlib.sha256(content).hexdigest(), Blobs(farm.blobs), count()

    def commit(worker: str) -> None:
        queue = SliceQueue(farm.client, worker, _LEASE_S)
        while (number := next(numbers)) < len(jobs) * slices:
            job_id = jobs[number % len(jobs)]
            lease = queue.lease(_VARIANTS, job_id, in_turn=True)
            if lease is None or lease.job_id != job_id:
                raise AssertionError("fewer slices are planned than are to be committed")
            name = blobs.partial(lease.job_id, lease.index, worker)
            store.put(name, content)
            record = made_up_record(lease, blob=name, sha256=sha256, worker=worker, render_s=1.0)
            queue.commit(lease, record, width=size, height=size, notes=())

    with ThreadPoolExecutor(_HANDS) as hands:
        list(hands.map(commit, (f"worker-{number}" for number in range(_HANDS))))
