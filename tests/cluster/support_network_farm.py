"""A farm whose Redis, monitor and workers have a host each, and a network between them."""

import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from plateau.farm.redis.embedded import EmbeddedRedis
from tests.cluster.support_network import Network
from tests.support.farms.faulty_farm import FaultyFarm

REDIS: Final = "redis"
MONITOR: Final = "monitor"
WORKERS: Final = ("worker-1", "worker-2", "worker-3")

HOSTS: Final = (REDIS, MONITOR, *WORKERS)

_PORT: Final = 6379

#: Takes three workers some seconds, so that a fault of some seconds meets it.
SPEC: Final[dict[str, Any]] = {
    "parameters": {"width": 64, "height": 64},
    "step": 40,
    "slice_spp": 20,
    "max_spp": 3000,
    "rule": {"name": "reverse", "window": 5, "epsilon": 4.0},
}


def cases(every: Iterable[Any], short: Iterable[Any]) -> list[Any]:
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

    def start_all(self, **environment: str) -> None:
        """Start the monitor and the workers, and wait for the latter."""
        self.start_on(MONITOR, "monitor", **environment)
        for host in WORKERS:
            self.start_on(host, "worker", **environment)
        self.wait_for_workers(len(WORKERS))
