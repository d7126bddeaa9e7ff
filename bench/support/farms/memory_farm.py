"""The memory of a farm's processes, and slices for them that nobody renders."""

from __future__ import annotations

import hashlib
import threading
import time
from contextlib import contextmanager, suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

from bench.support.farms.service_farm import ServiceFarm
from bench.support.farms.simulated import about, made_up_partial, made_up_record
from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.queue import Committed, Lease, SliceQueue
from plateau.farm.redis.link import connect

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

#: A word of each process's command line.
_ROLES = {
    "API": "api",
    "monitor": "monitor",
    "worker": "worker",
    "render child": "plateau.worker.child",
}
#: A variant that no worker here has, so that its slices are left to `made_up`.
MADE_UP = "cuda_ad_rgb"
_WORKER = "made-up"
_LEASE_S = 600.0
_HEARTBEAT_S = 3.0
_LOOK_S = 0.01


def peaks(farm: ServiceFarm) -> dict[str, float]:
    """Return the most memory that each process of a farm ever had resident, in MB, by role."""
    found = {}
    for process in psutil.Process(farm.pid).children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            words = process.cmdline()
            for role, word in _ROLES.items():
                if word in words:
                    found[role] = _peak_mb(process.pid)
    return found


def _peak_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024 / 1e6


@contextmanager
def made_up(
    redis_url: str, store: str, jobs: Collection[str], *, slices: int, width: int, height: int
) -> Iterator[None]:
    """Commit this many slices of noise for each job, as a worker does.

    The queue chooses the slices. Those of finished jobs stay leased while the context lasts, so
    that the queue offers the next job's.
    """
    with connect(redis_url) as client:
        queue, keeps = SliceQueue(client, _WORKER, _LEASE_S), Blobs(store)
        left, kept = dict.fromkeys(jobs, slices), list[Lease]()
        with _alive(redis_url, kept):
            while any(count > 0 for count in left.values()):
                lease = queue.lease((MADE_UP,), None, in_turn=False)
                if lease is None:
                    time.sleep(_LOOK_S)  # until the monitor plans the next ones
                    continue
                if left[lease.job_id] <= 0:
                    kept.append(lease)
                    continue
                if _commit(queue, keeps, lease, width, height):
                    left[lease.job_id] -= 1
            yield


def _commit(queue: SliceQueue, store: Blobs, lease: Lease, width: int, height: int) -> bool:
    """Put and commit the slice; return whether it counts."""
    content = made_up_partial(
        width=width,
        height=height,
        spp=lease.spec.slice_spp,
        variant=MADE_UP,
        job_id=lease.job_id,
        index=lease.index,
    )
    name = blobs.partial(lease.job_id, lease.index, _WORKER)
    store.put(name, content)
    sha256 = hashlib.sha256(content).hexdigest()
    record = made_up_record(lease, blob=name, sha256=sha256, worker=_WORKER, render_s=0.001)
    answer = queue.commit(lease, record, width=width, height=height, notes=())
    return answer is Committed.COMMITTED


@contextmanager
def _alive(redis_url: str, leases: list[Lease]) -> Iterator[None]:
    """Keep the worker and its leases alive."""
    over = threading.Event()

    def beat() -> None:
        with connect(redis_url) as client:
            queue = SliceQueue(client, _WORKER, _LEASE_S)
            said = about(_WORKER, (MADE_UP,), datetime.now(timezone.utc).isoformat())
            while not over.wait(_HEARTBEAT_S):
                queue.heartbeat(said, tuple(leases))

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
