"""Memory and disk stay bounded: 200 jobs queued, 10 rendering, thousands of slices.

Redis, API and monitor are real processes, of which memory is measured; the slices are real, small
partials, put and committed by threads that play four workers. ``LONG_TESTS=1`` renders 15,000
slices instead of 1,500, which takes some minutes.
"""

import re
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import psutil
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from plateau.farm.redis.link import connect
from plateau.farm.sweep import sweep
from plateau.picture.previews import MOST as MOST_PREVIEWS
from tests.support import long_tests
from tests.support.farms.ledger_farm import about
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.faults.invariants import RESULTS, check_job, is_of_no_job
from tests.support.until import until

QUEUED, RENDERING, WORKERS = 200, 10, 4
SUBMITTED = 20  #: of the queued ones, by the API
SLICES = 1500 if long_tests.WANTED else 150  #: of each rendering job
SLICE_SPP, STEP = 10, 100
LEASE_S = 15.0

#: Old and new while one replaces the other: a checkpoint, and a set of pictures; and previews.
MOST_OTHERS = 2 + 2 * len((*RESULTS, "difference.png", "noise.png")) + MOST_PREVIEWS + 1

#: What a process may grow from the run's first third to its last, in bytes. Were the film of each
#: slice kept in memory, it would be 10 MB in the short form and 100 MB in the long.
MOST_GROWTH = 6_000_000
#: What Redis may keep of each, in bytes. Of a slice, a line of the ledger and an event stay; of
#: every tenth, a point and its event. Of a job its spec, and a block of 4 kB for each of its
#: streams: the slices to render, which go at its end, and the events.
MOST_PER_SLICE = 1000
MOST_PER_JOB = 16_000
#: An ended job keeps what it had while it waited, and how it ended.
OF_AN_END = 500
#: And after all jobs were forgotten: scripts, buffers of clients, and idempotency keys for a day.
MOST_LEFT = 500_000


@dataclass(frozen=True, kw_only=True)
class Sample:
    """What the farm holds at a moment, in bytes where nothing else is said."""

    slices: int  #: committed so far
    uss: dict[str, int]  #: memory that a process has for itself
    redis: int


def spec_for(variant: str) -> JobSpec:
    spp = SLICES * SLICE_SPP
    rule = {"name": "fixed", "spp": spp}
    return JobSpec.model_validate(
        {"step": STEP, "slice_spp": SLICE_SPP, "max_spp": spp, "rule": rule, "variant": variant}
    )


class Soak:
    """The farm under load, and what was measured."""

    def __init__(self, farm: RealFarm, folder: Path) -> None:
        self.farm = farm
        self.folder = folder
        self.samples: list[Sample] = []
        self._processes = {
            name: psutil.Process(process.pid)
            for name, process in zip(("api", "monitor"), farm.processes, strict=True)
        }
        self._processes["redis"] = psutil.Process(farm.redis.process.pid)
        self._owners = Ownerships(farm.redis_client, LEASE_S)

    def used_memory(self) -> int:
        """What Redis holds, but for our scripts, which it loads as each is run first.

        Nor do Redis 7's histograms of latencies count, 40 kB for each command that was ever given.
        """
        self.farm.redis_client.config_resetstat()
        memory = self.farm.redis_client.info("memory")
        return int(memory["used_memory"]) - int(memory["used_memory_scripts"])

    def redis_bytes(self, job_id: str) -> int:
        """What Redis keeps of a job."""
        client = self.farm.redis_client
        found = [keys.job(job_id), *(keys.job(job_id, part) for part in keys.JOB_PARTS)]
        return sum(client.memory_usage(key, samples=0) or 0 for key in found)

    def submit(self, count: int, scene: Path | str, variant: str) -> list[str]:
        return [self.farm.client.submit(scene, spec_for(variant)).id for _ in range(count)]

    @contextmanager
    def workers(self) -> Iterator[None]:
        """Threads that lease, render noise, and commit."""
        over = threading.Event()

        def work(number: int) -> None:
            with connect(self.farm.redis.url, 120.0) as client:
                _work(client, self.farm.redis.url, self.folder, f"noise-{number}", over)

        with ThreadPoolExecutor(WORKERS) as pool:
            working = [pool.submit(work, number) for number in range(WORKERS)]
            try:
                yield
            finally:
                over.set()
        for one in working:
            one.result()

    def look(self, rendering: list[str]) -> None:
        """Use the API as people do, check what the jobs hold, and take a sample."""
        client = self.farm.client
        shown = rendering[len(self.samples) % len(rendering)]
        list(client.all_jobs())
        client.curve(shown)
        client.happened(shown)
        if client.job(shown).points > 1:
            client.image(shown)
        jobs = [self.farm.jobs.get(job_id) for job_id in rendering]
        for job in jobs:
            self._check_blobs(job)
        self.samples.append(
            Sample(
                slices=sum(job.committed_spp for job in jobs) // SLICE_SPP,
                uss={name: one.memory_full_info().uss for name, one in self._processes.items()},
                redis=self.used_memory(),
            )
        )

    def _check_blobs(self, job: Job) -> None:
        """A running job holds what is not in its checkpoint yet, and little else."""
        checkpoint = self._owners.checkpoint(job.id)
        contained = checkpoint.slices if checkpoint else 0
        names = self.farm.store.names(blobs.of_job(job.id))
        planned = int(self.farm.redis_client.hget(keys.job(job.id), "planned"))
        partials = {
            name: int(found.group(1))
            for name in names
            if (found := re.search(r"partials/(\d+)-", name))
        }
        assert len(set(partials.values())) == len(partials)
        assert all(index < planned for index in partials.values())
        assert len(names) - len(partials) <= MOST_OTHERS
        stale = [name for name, index in partials.items() if index < contained]
        until(lambda: not any(map(self.farm.store.exists, stale)))

    def growth(self, name: str) -> float:
        """By how much a process's own memory grew from the run's first third to its last."""
        last = self.samples[-1].slices
        first_third = [one.uss[name] for one in self.samples if last / 6 < one.slices < last / 3]
        last_third = [one.uss[name] for one in self.samples if one.slices > last * 2 / 3]
        return median(last_third) - median(first_third)


def _work(client: redis.Redis, url: str, folder: Path, worker: str, over: threading.Event) -> None:
    farm = NoiseFarm(client, url, folder)
    farm.queue = SliceQueue(client, worker, LEASE_S)
    heard = float("-inf")
    while not over.is_set():
        if time.monotonic() > heard + LEASE_S / 3:
            farm.queue.heartbeat(about(worker), ())
            heard = time.monotonic()
        lease = farm.lease()
        if lease is None:
            over.wait(0.01)
        else:
            farm.commit(lease)
    farm.queue.leave()


@pytest.mark.timeout(3600)
@pytest.mark.long
def test_many_jobs_and_slices(tmp_path: Path, cache: Path) -> None:
    with RealFarm(tmp_path, cache, plain=True, PLATEAU_LEASE_S=str(LEASE_S)) as farm:
        farm.start("monitor")
        soak = Soak(farm, tmp_path)
        empty = soak.used_memory()
        # Given ten jobs to render, and two hundred for which there is no worker
        first, *_ = soak.submit(1, BOX, "scalar_rgb")
        scene = farm.jobs.get(first).scene_sha256
        rendering = [first, *soak.submit(RENDERING - 1, scene, "scalar_rgb")]
        queued = soak.submit(SUBMITTED, scene, "cuda_ad_rgb")
        until(
            lambda: all(farm.redis_client.hget(keys.job(one), "planned") != "0" for one in queued)
        )
        per_queued = max(map(soak.redis_bytes, queued))
        for _ in range(QUEUED - SUBMITTED):  # without the API: it takes half the test's time
            made = farm.jobs.create(spec_for("cuda_ad_rgb"), name="box.zip", scene_sha256=scene)
            queued.append(made.job.id)
        # When the ten are rendered
        with soak.workers():
            while any(farm.jobs.get(job_id).finished_at is None for job_id in rendering):
                soak.look(rendering)
                time.sleep(0.3)
        soak.look(rendering)
        per_slice = max(map(soak.redis_bytes, rendering)) / SLICES
        # Then memory did not follow the slices
        for name in ("api", "monitor"):
            assert soak.growth(name) < MOST_GROWTH, name
        most = empty + (QUEUED + RENDERING) * MOST_PER_JOB + RENDERING * SLICES * MOST_PER_SLICE
        assert max(one.redis for one in soak.samples) < most
        # What Redis keeps of a slice and of a job is little
        assert per_slice < MOST_PER_SLICE
        assert per_queued < MOST_PER_JOB
        # And of the ten, results, sums and previews are on the disk and nothing else
        for job_id in rendering:
            check_job(farm.jobs, farm.store, farm.redis_client, job_id)
        assert {name.split("/")[1] for name in farm.store.names(blobs.JOBS)} == set(rendering)
        # When the others are cancelled
        for job_id in queued:
            farm.jobs.cancel(job_id)
        until(lambda: all(farm.jobs.get(one).finished_at is not None for one in queued), 120)
        per_ended = max(map(soak.redis_bytes, queued))
        assert per_ended < per_queued + OF_AN_END
        # And everything is forgotten
        swept = sweep(farm.redis_client, farm.store, results_older_than_s=0)
        assert (swept.jobs, swept.orphans) == (QUEUED + RENDERING, 0)
        assert farm.store.names(blobs.JOBS) == []
        # Then Redis keeps nothing for a job that was
        left = farm.redis_client.scan_iter("*", count=1000)
        assert [key for key in left if not is_of_no_job(key)] == []
        assert soak.used_memory() - empty < MOST_LEFT
