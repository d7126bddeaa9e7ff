"""A process of many simulated workers, each with its own connections, which do not render.

Each leases a slice, waits as long as a render would take, puts a prepared partial into the blob
store and commits it, by the code of real workers. Without work it waits to be woken. Each renews
its leases, and listens for jobs that end.
"""

import hashlib
import json
import os
import random
import sys
import threading
import time
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from itertools import cycle

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle.analytic import AnalyticScene
from plateau.farm.images.exr import Partial, encode_partial
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.process.waits import Backoff, Stop
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.worker.renderers.analytic.picture import Picture

# As in `plateau.worker.supervisor.supervisor`.
_IDLE_S, _TURN_S, _HEARTBEAT_S, _LEASE_S = (0.5, 5.0), 20.0, 5.0, 15.0
_VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
_STACK_BYTES = 1 << 19


@dataclass(frozen=True)
class Crew:
    """The arguments of a process of simulated workers."""

    redis_url: str
    blobs: str
    name: str
    workers: int
    render_s: float  #: mean time of a slice
    size: int  #: width and height of the partials in pixels


@dataclass(frozen=True)
class Slice:
    """When a slice was committed, by the monotonic clock, and how long each step took."""

    at: float
    lease_s: float
    commit_s: float


class _Worker:
    """One simulated worker."""

    def __init__(self, crew: Crew, number: int, content: bytes, stop: Stop) -> None:
        self.id = f"{crew.name}-{number}"
        self._crew, self._content, self._stop = crew, content, stop
        self._random = random.Random(self.id)
        self._sha256 = hashlib.sha256(content).hexdigest()
        client = connect(crew.redis_url)
        self._queue = SliceQueue(client, self.id, _LEASE_S)
        self._store = Blobs(crew.blobs)
        self._work = Wake(client, keys.wake_worker(self.id))
        self._news = Wake(client, keys.WAKE_WORKERS)
        self._started_at = datetime.now(timezone.utc).isoformat()
        self._held: Lease | None = None
        self._turn = ("", 0.0)
        self.done: list[Slice] = []

    def connect(self) -> None:
        self.heartbeat()
        for wake in (self._work, self._news):
            wake.wait(0.0, self._stop)

    def run(self) -> None:
        self._stop.wait(self._random.uniform(0, self._crew.render_s))  # workers start unevenly
        idle = Backoff(*_IDLE_S)
        while not self._stop.is_set():
            started = time.monotonic()
            job, since = self._turn
            lease = self._queue.lease(_VARIANTS, job, in_turn=started < since + _TURN_S)
            if lease is None:
                if self._work.wait(idle.delay_s(), self._stop):
                    idle.reset()
                continue
            idle.reset()
            self._held = lease
            if lease.job_id != job:
                self._turn = (lease.job_id, started)
            self._serve(lease, started)
            self._held = None

    def _serve(self, lease: Lease, started: float) -> None:
        leased = time.monotonic()
        self._stop.wait(self._crew.render_s * self._random.uniform(0.8, 1.2))
        rendered = time.monotonic()
        name = blobs.partial(lease.job_id, lease.index, f"{self.id}-{lease.tries}")
        self._store.put(name, self._content)
        stored = time.monotonic()
        record = SliceRecord(
            index=lease.index,
            spp=lease.spec.slice_spp,
            first_seed=10 * lease.index,  # no other slice has its seeds
            last_seed=10 * lease.index + 2,
            blob=name,
            sha256=self._sha256,
            worker=self.id,
            render_s=rendered - leased,
        )
        size = self._crew.size
        answer = self._queue.commit(lease, record, width=size, height=size, notes=())
        now = time.monotonic()
        if answer == "committed":
            self.done.append(Slice(now, leased - started, now - stored))

    def heartbeat(self) -> None:
        held = self._held
        said = about(self.id, self._started_at, held, len(self.done))
        self._queue.heartbeat(said, (held,) if held else ())

    def listen(self) -> None:
        self._news.wait(0.0, self._stop)


def about(worker: str, started_at: str, held: Lease | None, slices_done: int) -> dict[str, object]:
    """Return the fields of a heartbeat, those of `plateau.farm.model.worker.Worker`."""
    return {
        "id": worker,
        "host": "simulated",
        "pid": os.getpid(),
        "variants": _VARIANTS,
        "threads": 1,
        "job": held.job_id if held else None,
        "slice": held.index if held else None,
        "slices_done": slices_done,
        "samples_per_s": None,
        "last_error": None,
        "trouble": None,
        "started_at": started_at,
    }


def made_up_partial(size: int) -> bytes:
    """Return the EXR of a square partial of grey noise."""
    picture = Picture(AnalyticScene(width=size, height=size, light="grey"))
    return encode_partial(
        Partial(
            job_id="simulated",
            index=0,
            first_seed=0,
            last_seed=2,
            spp=25,
            variant=_VARIANTS[0],
            scene_sha256="0" * 64,
            pixels=picture.film(25, seed=0),
        )
    )


def _keep_alive(workers: list[_Worker], stop: Stop) -> None:
    """Send the workers' heartbeats, evenly over the interval, and read their announcements."""
    for worker in cycle(workers):
        if stop.wait(_HEARTBEAT_S / len(workers)):
            return
        worker.heartbeat()
        worker.listen()


def main() -> None:
    """Work until standard input ends, then write the slices to standard output as JSON."""
    crew, stop = Crew(**json.loads(sys.argv[1])), Stop()
    # The same for every slice: no rule is to be satisfied.
    content = made_up_partial(crew.size)
    workers = [_Worker(crew, number, content, stop) for number in range(crew.workers)]
    for worker in workers:
        worker.connect()
    print("ready", flush=True)
    sys.stdin.readline()  # the word to begin
    threading.stack_size(_STACK_BYTES)
    threads = [threading.Thread(target=worker.run) for worker in workers]
    threads.append(threading.Thread(target=_keep_alive, args=(workers, stop)))
    for thread in threads:
        thread.start()
    sys.stdin.read()
    stop.set()
    for thread in threads:
        thread.join()
    json.dump([asdict(one) for worker in workers for one in worker.done], sys.stdout)


if __name__ == "__main__":
    main()
