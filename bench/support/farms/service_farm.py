"""A whole farm on this machine, as `plateau up` starts it, with thousands of finished jobs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import httpx

from bench import ROOT
from bench.support.farms.simulated import POINT
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import check_schema
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect

if TYPE_CHECKING:
    from collections.abc import Callable

_START_S = 120.0
#: One job in this many has failed and is in the batch `BATCH`.
RARE = 200
BATCH = "a rare batch"
#: How many threads create jobs, so that they share Redis's waits for its disk.
_HANDS = 16


class ServiceFarm:
    """`plateau up` in a folder of its own, while the context lasts.

    It starts with this many finished `jobs`, of which one in `RARE` has failed and the others are
    cancelled. `threads` are those of the render child of each worker.
    """

    def __init__(self, folder: Path, *, jobs: int, threads: int, workers: int = 1) -> None:
        _fill(folder, jobs)
        environment = {
            **os.environ,
            "PLATEAU_DATA": str(folder),
            "PLATEAU_THREADS": str(threads),
        }
        for name in ("PLATEAU_REDIS_URL", "PLATEAU_BLOBS"):
            environment.pop(name, None)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "plateau", "up", "--port", "0", "--workers", str(workers)],
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> ServiceFarm:
        greeting = ""
        while "Ctrl-C" not in greeting:
            line = self._process.stdout.readline() if self._process.stdout else ""
            if not line:
                self._process.wait()
                raise AssertionError(f"the farm did not start: {greeting}")
            greeting += line
        self.url = _said(r"listens at (\S+)", greeting)
        self.redis_url = _said(r"PLATEAU_REDIS_URL=(\S+)", greeting)
        self.blobs = _said(r"PLATEAU_BLOBS=(\S+)", greeting)
        self._client = connect(self.redis_url)
        self.jobs = Jobs(self._client)
        self.pid = self._process.pid
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
        with self._process:  # which closes its output and waits
            self._process.terminate()

    def steer(self, job_id: str, to: str) -> None:
        """Pause a job and wait until its worker is idle, or resume it and wait until it works."""
        httpx.post(f"{self.url}/v1/jobs/{job_id}/{to}", trust_env=False).raise_for_status()
        self.wait(lambda: any(one.job for one in self.jobs.workers()) == (to == "resume"))

    def clear(self, keep: str) -> None:
        """Cancel every unfinished job but one."""
        for state in (JobState.QUEUED, JobState.RENDERING):
            found, _ = self.jobs.search(state=state, limit=100_000)
            for job in found:
                if job.id != keep:
                    self.jobs.cancel(job.id)
        self.wait(lambda: self._client.scard(keys.UNFINISHED) == 1)

    @staticmethod
    def wait(condition: Callable[[], bool], within_s: float = _START_S) -> None:
        """Wait until the condition holds."""
        deadline = time.monotonic() + within_s
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError("the farm did not do what it was asked to")
            time.sleep(0.1)


def _said(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    if found is None:
        raise AssertionError(f"{pattern} is not in {text}")
    return found[1]


def _fill(folder: Path, count: int) -> None:
    """Make a data folder with this many finished jobs."""
    server = EmbeddedRedis(folder / "redis")
    try:
        with connect(server.url) as client:
            check_schema(client)
            check_pair(client, Blobs(str(folder / "blobs")))
            jobs, owners = Jobs(client), Ownerships(client, 60)
            with ThreadPoolExecutor(_HANDS) as hands:
                list(hands.map(lambda number: _make(jobs, owners, number), range(count)))
    finally:
        server.stop()


def _make(jobs: Jobs, owners: Ownerships, number: int) -> None:
    rare = number % RARE == 0
    spec = JobSpec(batch=BATCH if rare else f"batch {number // 40}")
    job = jobs.create(spec, name="box.zip", scene_sha256="0" * 64).job
    owned = owners.acquire(job.id)
    if owned is None:
        raise AssertionError(f"somebody owns the new job {job.id}")
    owners.append_point(owned, 100, POINT)
    owners.end(
        owned, JobState.FAILED if rare else JobState.CANCELLED, "person", "as a benchmark wants it"
    )
    owners.finish(owned, keeps_sums=False)
