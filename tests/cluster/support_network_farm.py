"""A farm whose Redis, monitor and workers have a host each, and a network between them."""

import os
import signal
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, TypeVar

from plateau.farm.blobs import names as blobs
from plateau.farm.ledger.workers import Workers
from plateau.farm.redis.embedded import EmbeddedRedis
from tests.cluster.support_network import Network
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.until import until

REDIS: Final = "redis"
MONITOR: Final = "monitor"
WORKERS: Final = ("worker-1", "worker-2", "worker-3")
LATE: Final = "late"  #: a host for one more worker
HOSTS: Final = (REDIS, MONITOR, *WORKERS, LATE)

_PORT: Final = 6379

#: Takes three workers some seconds, so that a fault of some seconds meets it.
SPEC: Final[dict[str, Any]] = {
    "parameters": {"width": 64, "height": 64},
    "step": 40,
    "slice_spp": 20,
    "max_spp": 3000,
    "rule": {"name": "reverse", "window": 5, "epsilon": 4.0},
}


Case = TypeVar("Case")


def cases(every: Iterable[Case], short: Iterable[Case]) -> list[Case]:
    """All cases in the long form, a few of them in the short one, which CI runs."""
    return list(short if os.environ.get("CLUSTER_TESTS") == "short" else every)


class _NetworkRedis(EmbeddedRedis):
    """A Redis on a host of a network, and on a Unix socket for the test."""

    def __init__(self, data: Path, network: Network) -> None:
        self._network = network
        super().__init__(data)

    def _launch(self) -> None:
        inside = self._network.on(REDIS)
        if self._command[: len(inside)] != [*inside]:
            listen = ("--port", str(_PORT), "--bind", "0.0.0.0", "--protected-mode", "no")
            self._command = [*inside, *self._command, *listen]
        super()._launch()


class NetworkFarm(FaultyFarm):
    """A farm over a network; the test's own way to Redis and to the blobs is not part of it.

    The API that `client` talks to has the test's way too, and sees what is so whatever the network
    does. The blobs are in a folder that all hosts share.
    """

    def __init__(self, network: Network, folder: Path, cache: Path, **settings: str) -> None:
        self.network = network
        self.redis_url = f"redis://{network.address(REDIS)}:{_PORT}"
        super().__init__(folder, cache, **settings)

    def _start_redis(self, data: Path) -> EmbeddedRedis:
        return _NetworkRedis(data, self.network)

    def start_on(
        self, host: str, role: str, *arguments: str, **environment: str
    ) -> subprocess.Popen[bytes]:
        """Start a process on a host of the network."""
        inside = self.network.on(host)
        environment.setdefault("PLATEAU_REDIS_URL", self.redis_url)
        return self.start(role, *arguments, inside=inside, **environment)

    def start_armed_on(
        self, host: str, role: str, where: str, **stage: Any
    ) -> subprocess.Popen[bytes]:
        """Start a process on a host that a signal hits at a stage; see `FaultyFarm.start_armed`."""
        inside = self.network.on(host)
        return self.start_armed(
            role, where, inside=inside, PLATEAU_REDIS_URL=self.redis_url, **stage
        )

    def start_all(self, **environment: str) -> None:
        """Start the monitor and the workers, and wait for the latter."""
        self.start_on(MONITOR, "monitor", **environment)
        for host in WORKERS:
            self.start_on(host, "worker", **environment)
        self.wait_for_workers(len(WORKERS))


class LateWorker:
    """A worker on a host of its own, stopped between its first partial and that one's commit."""

    def __init__(self, farm: NetworkFarm) -> None:
        self._farm = farm
        where = "plateau.farm.ledger.queue:SliceQueue.commit"
        self._process = farm.start_armed_on(LATE, "worker", where, signal_name="SIGSTOP")
        until(self._ids)
        [self.id] = self._ids()
        self._drained: list[str] = []

    def _ids(self) -> list[str]:
        found = self._farm.client.workers()
        return [one.id for one in found if one.pid == self._process.pid]

    def is_about_to_commit(self) -> tuple[str, int]:
        """Submit the job, and wait until it has put its first partial.

        Returns the job and the slice's index. The others take no work before it goes on.
        """
        workers = Workers(self._farm.redis_client)
        others = [one.id for one in self._farm.client.workers() if one.id != self.id]
        for other in others:
            workers.drain(other)
        self._drained = others
        job = self._farm.submit(**SPEC).id
        self._farm.wait_until_stopped(self._process)
        names = self._farm.store.names(blobs.partials(job))
        name = next(name for name in names if f"-{self.id}-" in name)
        return job, int(name.rpartition("/")[2].partition("-")[0])

    def go_on(self) -> None:
        """Let it try to commit, and the others take work."""
        self._farm.resume(self._process)
        for other in self._drained:
            Workers(self._farm.redis_client).resume(other)

    def tries_of(self, job: str, index: int) -> list[str]:
        """How its tries of the slice ended."""
        entries = self._farm.jobs.log(job, index)
        return [entry.what for entry in entries if entry.worker == self.id]

    def end(self) -> None:
        """Stop it; harmless to repeat."""
        if self._process in self._farm.processes:
            self._process.send_signal(signal.SIGCONT)
            self._process.send_signal(signal.SIGTERM)
            assert self._process.wait(60) == 0
            self._farm.processes.remove(self._process)
