"""A real farm in real processes: Redis, API, monitor and workers, each one to be killed."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psutil
import redis

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import Pixels, decode_image
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.job import CurvePoint
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.wire.views import JobView
from tests.support import FRAMES
from tests.support.processes.forked import FORKED, fork_server
from tests.support.until import until

BOX = Path(__file__).parents[3] / "plateau" / "scenes" / "box"


class Farm:
    """A farm that runs somewhere, as its users and its keeper see it."""

    jobs: Jobs
    store: Blobs
    redis_client: redis.Redis
    client: Client

    def submit(self, scene: Path = BOX, **spec: object) -> JobView:
        return self.client.submit(scene, JobSpec.model_validate(FRAMES | spec))

    def submit_half_way(self, scene: Path = BOX, **spec: object) -> str:
        """A job that is in the middle of its work, though this process be slow to look at it."""

        def half_way() -> str | None:
            job = self.submit(scene, **spec).id
            until(lambda: self.jobs.get(job).points >= 3)
            return None if self.jobs.get(job).state.ended else job

        return until(half_way)

    def image(self, job: JobView) -> Pixels:
        return decode_image(self.client.image(job.id, "image.exr"))

    def curve(self, job: JobView) -> list[dict[str, object]]:
        """The curve but for the times of its points."""
        points: list[CurvePoint] = self.client.curve(job.id)
        return [point.model_dump(exclude={"at"}) for point in points]


class RealFarm(Farm):
    """Starts processes as a user would: ``python -m plateau …`` with settings by environment.

    They are forked from one that has imported Plateau, unless they are to be `plain`.
    """

    def __init__(
        self,
        folder: Path,
        cache: Path,
        blobs: Path | str | None = None,
        *,
        plain: bool = False,
        **settings: str,
    ) -> None:
        self._server = None if plain else fork_server()
        self.redis = self._start_redis(folder / "redis")
        self.environment = {
            **os.environ,
            "PLATEAU_REDIS_URL": self.redis.url,
            "PLATEAU_BLOBS": str(blobs or folder / "blobs"),
            "PLATEAU_CACHE": str(cache),
            "PLATEAU_THREADS": "1",
            # So that a killed process is missed soon.
            "PLATEAU_LEASE_S": "2",
            **settings,
        }
        self.store = Blobs(str(blobs or folder / "blobs"))
        self.redis_client = connect(self.redis.url, 120.0)  # no test asks a second time
        self.jobs = Jobs(self.redis_client)
        self.processes: list[subprocess.Popen[bytes]] = []
        self.staff: list[subprocess.Popen[bytes]] = []  #: of them, those that tests share
        _, self.url = self.start_api()
        self.client = Client(self.url, patience_s=120.0)

    def __enter__(self) -> "RealFarm":
        return self

    def __exit__(self, *error: object) -> None:
        self.client.close()
        left = [
            child
            for process in self.processes
            if process.poll() is None
            for child in psutil.Process(process.pid).children(recursive=True)
        ]
        for process in self.processes:
            process.send_signal(signal.SIGTERM)
        codes = {process.wait(60) for process in self.processes if process.poll() is None}
        self.redis.stop()
        # One that has just started knows no other end
        assert codes <= {0, -signal.SIGTERM}, "a process did not stop cleanly"
        _, alive = psutil.wait_procs(left, timeout=60)
        assert not alive, f"left behind: {alive}"

    def start(
        self,
        *arguments: str,
        passed: tuple[int, ...] = (),
        module: str = "plateau",
        inside: tuple[str, ...] = (),
        **environment: str,
    ) -> subprocess.Popen[bytes]:
        told = {**self.environment, **environment}
        if self._server is not None and module in FORKED and not inside:
            process = self._server.start(arguments, told, passed)
        else:
            command = [*inside, sys.executable, "-m", module, *arguments]
            process = subprocess.Popen(command, env=told, pass_fds=passed, start_new_session=True)
        self.processes.append(process)
        return process

    def workers(self, count: int) -> list[subprocess.Popen[bytes]]:
        return [self.start("worker") for _ in range(count)]

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """Kill a process outright; what it started must die by itself."""
        process.kill()
        process.wait()
        self.processes.remove(process)

    def stop_all(self, but: subprocess.Popen[bytes] | None = None) -> None:
        """Stop all but the API, and but this one if given, cleanly."""
        stopped = [process for process in self.processes[1:] if process is not but]
        for process in stopped:
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGTERM)
        codes = [process.wait(60) for process in stopped]
        self.processes = [process for process in self.processes if process not in stopped]
        # One that was told before it listened is ended by the signal itself.
        assert set(codes) <= {0, -signal.SIGTERM}, f"a process did not stop cleanly: {codes}"

    def _start_redis(self, data: Path) -> EmbeddedRedis:
        return EmbeddedRedis(data)

    def start_api(
        self, port: str = "0", start: Callable[..., subprocess.Popen[bytes]] | None = None
    ) -> tuple[subprocess.Popen[bytes], str]:
        """Start an API and wait until it is ready; returns its URL too."""
        reads, writes = os.pipe()
        options = ("--port", port, "--ready-fd", str(writes))
        process = (start or self.start)("api", *options, passed=(writes,))
        os.close(writes)
        with os.fdopen(reads) as pipe:
            return process, pipe.readline().strip()
