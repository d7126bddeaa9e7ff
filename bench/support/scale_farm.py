"""A farm's control plane, Redis and monitors as `plateau` starts them, and its costs."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import IO, Any

import psutil

from bench import ROOT
from bench.support.scale_workers import Crew, Slice
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import check_schema
from plateau.farm.model.spec import FixedSpec, JobSpec
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect

_START_S = 120.0
_MONITOR_LEASE_S = 6.0
#: Jobs that no rule ends during a measurement.
SPEC = JobSpec(max_spp=1_000_000, rule=FixedSpec(spp=1_000_000))
#: How many threads create jobs, so that they share Redis's waits for its disk.
_HANDS = 16
#: Processes of simulated workers, at most.
_CREWS = 4


@dataclass(frozen=True, kw_only=True)
class Sample:
    """The costs up to a moment: seconds, calls, bytes, slices."""

    at: float
    redis_cpu_s: float
    monitors_cpu_s: float
    merged: float  #: slices of the images that were judged

    def since(self, before: "Sample") -> "Sample":
        """Return the costs between two moments; `at` is then a duration."""
        own, other = asdict(self), asdict(before)
        return Sample(**{one.name: own[one.name] - other[one.name] for one in fields(self)})


class ControlPlane:
    """An embedded Redis in `folder`, and monitors, while the context lasts.

    Every write to Redis is on disk before it is answered, as always in Plateau.
    """

    def __init__(self, folder: Path, blobs: Path, *, monitors: int = 1) -> None:
        self._folder, self.blobs, self._count = folder, str(blobs), monitors
        self._monitors: list[psutil.Process] = []
        self._over = ExitStack()

    def __enter__(self) -> "ControlPlane":
        with ExitStack() as starting:
            self._server = EmbeddedRedis(self._folder / "redis")
            starting.callback(self._server.stop)
            self.client = starting.enter_context(connect(self._server.url))
            check_schema(self.client)
            check_pair(self.client, Blobs(self.blobs))
            self.jobs = Jobs(self.client)
            for _ in range(self._count):
                starting.callback(_kill, self._start_monitor())
            self.wait(lambda: self.client.zcard(keys.MONITORS) == self._count)
            self._over = starting.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.close()

    def _start_monitor(self) -> subprocess.Popen[bytes]:
        environment = {
            **os.environ,
            "PLATEAU_REDIS_URL": self._server.url,
            "PLATEAU_BLOBS": self.blobs,
            "PLATEAU_LEASE_S": str(_MONITOR_LEASE_S),
        }
        with (self._folder / "monitor.log").open("ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "plateau", "monitor"],
                cwd=ROOT,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        self._monitors.append(psutil.Process(process.pid))
        return process

    def add_jobs(self, count: int) -> None:
        """Create jobs, and wait until slices of all of them are planned."""
        with ThreadPoolExecutor(_HANDS) as hands:
            made = list(hands.map(lambda _: self._add_job(), range(count)))
        self.wait(lambda: all(self.client.hget(keys.job(one), "planned") or 0 for one in made))

    def _add_job(self) -> str:
        return self.jobs.create(SPEC, name="box.zip", scene_sha256="0" * 64).job.id

    @contextmanager
    def workers(self, count: int, *, render_s: float, size: int) -> Iterator[list[Slice]]:
        """Run simulated workers while the context lasts; the list then has their slices."""
        done: list[Slice] = []
        crews = min(_CREWS, count)
        with ExitStack() as over:
            started = []
            for number in range(crews):
                workers = count // crews + (number < count % crews)
                crew = Crew(self._server.url, self.blobs, f"crew-{number}", workers, render_s, size)
                started.append(over.enter_context(_crew(crew)))
            for process in started:  # all import and connect at the same time
                if _pipe(process.stdout).readline() != "ready\n":
                    raise AssertionError("simulated workers did not start")
            for process in started:
                print(file=_pipe(process.stdin), flush=True)
            yield done
            for process in started:
                _pipe(process.stdin).close()
            for process in started:
                done += [Slice(**one) for one in json.load(_pipe(process.stdout))]

    def sample(self) -> Sample:
        """Return the costs so far."""
        cpu = self.client.info("cpu")
        spent = [process.cpu_times() for process in self._monitors]
        return Sample(
            at=time.monotonic(),
            redis_cpu_s=cpu["used_cpu_user"] + cpu["used_cpu_sys"],
            monitors_cpu_s=sum(one.user + one.system for one in spent),
            merged=self._merged(),
        )

    def _merged(self) -> float:
        pipe = self.client.pipeline(transaction=False)
        for job_id in self.client.zrange(keys.JOBS, 0, -1):
            pipe.hget(keys.job(job_id), "spp")
        return sum(int(spp or 0) for spp in pipe.execute()) / SPEC.slice_spp

    @staticmethod
    def wait(condition: Callable[[], bool]) -> None:
        """Wait until the condition holds."""
        deadline = time.monotonic() + _START_S
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError("the farm did not do what it was asked to")
            time.sleep(0.05)


@contextmanager
def _crew(crew: Crew) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "bench.support.scale_workers", json.dumps(asdict(crew))],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        _kill(process)


def _kill(process: subprocess.Popen[Any]) -> None:
    """Kill a process whose work is no longer needed."""
    process.kill()
    for stream in (process.stdin, process.stdout):
        if stream is not None and not stream.closed:
            stream.close()
    process.wait()


def _pipe(stream: IO[str] | None) -> IO[str]:
    if stream is None:
        raise AssertionError("the process was started without a pipe")
    return stream
