"""A farm whose simulated workers render analytic scenes, and what they spend."""

from __future__ import annotations

import hashlib
import math
import tempfile
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from bench.support.farms.scale_farm import ControlPlane
from bench.support.farms.simulated import about
from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Partial, encode_partial
from plateau.farm.ledger.queue import Committed, SliceQueue, SliceRecord
from plateau.farm.model.slices.rounds import slice_zones
from plateau.farm.model.slices.zones import pixels_of
from plateau.farm.process.stop import Stop
from plateau.farm.redis import keys
from plateau.farm.redis.wake import Wake

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from bench.support.farms.synthetic_noise import Render
    from plateau.farm.ledger.jobs import Jobs
    from plateau.farm.ledger.queue import Lease
    from plateau.farm.model.job import Job
    from plateau.farm.model.spec import JobSpec
    from plateau.farm.redis.client import RedisClient

# As in `plateau.worker.supervisor.supervisor`.
_IDLE_S = 0.5
_LEASE_S = 15.0
_VARIANT = "analytic:numpy"
_PATIENCE_S = 600.0
#: How soon a slice is cancelled.
_CANCEL_S = 0.05


@dataclass
class Spent:
    """The work of all workers since the last `clear`."""

    spp: float = 0.0  #: samples over the pixels of the film, those of cancelled slices included
    busy_s: float = 0.0  #: upload and commit included
    at_work: int = 0  #: workers that have a slice
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def clear(self) -> None:
        """Start again, with the same workers at work."""
        with self._lock:
            self.spp, self.busy_s = 0.0, 0.0

    def add(self, *, spp: float = 0.0, busy_s: float = 0.0, at_work: int = 0) -> None:
        """Add a worker's work."""
        with self._lock:
            self.spp += spp
            self.busy_s += busy_s
            self.at_work += at_work


class NoiseCrew:
    """Workers that render the scene `render`, 1 spp of the whole film in `spp_s` seconds.

    `slowness` has a factor for each worker that takes longer.
    """

    render: Render

    def __init__(
        self,
        client: RedisClient,
        store: Blobs,
        spp_s: float,
        slowness: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._client, self._store, self._spp_s = client, store, spp_s
        self._slowness = slowness
        self.spent = Spent()
        self._ended: set[str] = set()

    def work(self, worker: str, stop: Stop) -> None:
        """Run one worker until `stop` is set."""
        queue = SliceQueue(self._client, worker, _LEASE_S)
        new_work = Wake(self._client, keys.wake_worker(worker))
        new_work.wait(0.0, stop)
        said = about(worker, (_VARIANT,), datetime.now(timezone.utc).isoformat())
        queue.heartbeat(said, ())
        while not stop.is_set():
            lease = queue.lease((_VARIANT,), None, in_turn=False)
            if lease is None:
                new_work.wait(min(_IDLE_S, queue.look_again_s), stop)
                continue
            started = time.monotonic()
            self.spent.add(at_work=1)
            self._serve(queue, lease, worker, stop)
            self.spent.add(at_work=-1, busy_s=time.monotonic() - started)
            queue.heartbeat(said, ())
        new_work.close()

    def listen(self, stop: Stop) -> None:
        """Listen for jobs that end, on behalf of all workers."""
        news = Wake(self._client, keys.WAKE_WORKERS)
        while not stop.is_set():
            self._ended |= {word.removeprefix("ended ") for word in news.wait(_IDLE_S, stop)}
        news.close()

    def _serve(self, queue: SliceQueue, lease: Lease, worker: str, stop: Stop) -> None:
        started, spec, size = time.monotonic(), lease.spec, self.render.size
        zones = slice_zones(spec, lease.round, size, size, border=0)
        spp = lease.spp * (pixels_of(zones) / size**2 if zones else 1)
        takes_s = self._spp_s * self._slowness.get(worker, 1.0) * spp
        over = {lease.job_id, f"{lease.job_id} {lease.entry}"}  # as announced
        parts = math.ceil(takes_s / _CANCEL_S)
        for _ in range(parts):
            if self._ended & over or stop.wait(takes_s / parts):
                queue.hand_back(lease, time.monotonic() - started, cause="it was cancelled")
                return
            self.spent.add(spp=spp / parts)
        schedule = spec.seed_schedule(lease.variant, size, size)
        first, last = schedule.seed_range(lease.index, lease.spp)
        film = self.render.picture.slice_film(schedule.passes(lease.index, lease.spp))
        if zones:
            film = np.concatenate(
                [film[y : y + h, x : x + w].reshape(-1, 4) for x, y, w, h in zones]
            )
        partial = Partial(
            job_id=lease.job_id,
            index=lease.index,
            first_seed=first,
            last_seed=last,
            spp=lease.spp,
            variant=lease.variant,
            scene_sha256=lease.scene_sha256,
            pixels=film,
            zones=zones,
        )
        content = encode_partial(partial)
        name = blobs.partial(lease.job_id, lease.index, f"{worker}-{lease.tries}")
        self._store.put(name, content)
        record = SliceRecord(
            index=lease.index,
            spp=lease.spp,
            first_seed=first,
            last_seed=last,
            blob=name,
            sha256=hashlib.sha256(content).hexdigest(),
            worker=worker,
            render_s=time.monotonic() - started,
        )
        answer = queue.commit(lease, record, width=size, height=size, notes=())
        if answer is not Committed.COMMITTED:
            self._store.delete(name)


@contextmanager
def noise_farm(
    workers: int, spp_s: float, slowness: Mapping[str, float] = MappingProxyType({})
) -> Iterator[tuple[Jobs, NoiseCrew]]:
    """Run Redis, a monitor and simulated workers, ``worker-0`` and on, while the context lasts."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "redis").mkdir()
        with ControlPlane(folder, folder / "blobs") as plane:
            crew = NoiseCrew(plane.client, Blobs(str(folder / "blobs")), spp_s, slowness)
            with _working(crew, workers):
                yield plane.jobs, crew


@contextmanager
def _working(crew: NoiseCrew, workers: int) -> Iterator[None]:
    stop = Stop()
    threads = [
        threading.Thread(target=crew.listen, args=(stop,)),
        *(
            threading.Thread(target=crew.work, args=(f"worker-{number}", stop))
            for number in range(workers)
        ),
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


@dataclass(frozen=True)
class Ended:
    """A job that has ended."""

    job: Job
    seconds: float  #: from its first lease to its end


def run_job(jobs: Jobs, spent: Spent, spec: JobSpec) -> Ended:
    """Submit a job and wait until it has ended and no worker has a slice of it in hand."""
    spent.clear()
    job_id = jobs.create(spec, name="noise", scene_sha256="0" * 64).job.id
    deadline = time.monotonic() + _PATIENCE_S
    while (job := jobs.get(job_id)).finished_at is None or spent.at_work:
        if time.monotonic() > deadline:
            raise AssertionError(f"the job has not ended: {job}")
        time.sleep(0.05)
    assert job.started_at is not None
    assert job.ended_at is not None
    return Ended(job, (job.ended_at - job.started_at).total_seconds())
