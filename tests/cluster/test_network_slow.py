"""Networks that are slow: a Redis 200 ms away, and an S3 that takes its time."""

import contextlib
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cluster.support_network import Network
from tests.cluster.support_network_farm import HOSTS, REDIS, NetworkFarm
from tests.cluster.support_s3 import BUCKET, S3Server
from tests.cluster.support_toxiproxy import Toxiproxy
from tests.support.farms.faulty_farm import SPEC, FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome

pytestmark = pytest.mark.long_form

_PORT = 6380


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Outcome:
    """What comes of the job on a farm without a network."""
    with FaultyFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        farm.start("monitor")
        farm.start("worker")
        return outcome(farm, farm.submit(**SPEC).id)


def test_a_redis_200_ms_away(
    tool: Callable[[str], Path], tmp_path: Path, cache: Path, undisturbed: Outcome
) -> None:
    with (
        Network(tool, *HOSTS) as network,
        NetworkFarm(network, tmp_path, cache) as farm,
        Toxiproxy(tool("toxiproxy"), inside=network.on(REDIS)) as proxy,
    ):
        proxy.forward("redis", f"0.0.0.0:{_PORT}", "127.0.0.1:6379")
        proxy.delay("redis", 200)
        farm.redis_url = f"redis://{network.address(REDIS)}:{_PORT}"
        farm.start_all()
        job = farm.submit(**SPEC).id
        assert_same(outcome(farm, job), undisturbed)
        assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []
        farm.stop_all()


@contextlib.contextmanager
def _slow(tool: Callable[[str], Path], server: S3Server) -> Iterator[str]:
    """The endpoint of an S3 server whose answers come 300 ms later, over a line of 300 KB/s."""
    upstream = server.endpoint.partition("://")[2]
    listen, api = (f"127.0.0.1:{_free_port()}" for _ in range(2))
    with Toxiproxy(tool("toxiproxy"), int(api.rpartition(":")[2])) as proxy:
        proxy.forward("s3", listen, upstream)
        proxy.delay("s3", 300)
        proxy.narrow("s3", 300)
        yield f"http://{listen}"


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port: int = taken.getsockname()[1]
        return port


def test_a_slow_s3(
    tool: Callable[[str], Path],
    tmp_path: Path,
    cache: Path,
    undisturbed: Outcome,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with S3Server(tool("versitygw"), tmp_path / "s3") as server, _slow(tool, server) as endpoint:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        where = f"s3://{BUCKET}/slow"
        slow = {"AWS_ENDPOINT_URL": endpoint}
        with FaultyFarm(tmp_path / "farm", cache, where, **slow) as farm:
            farm.start("monitor")
            farm.workers(2)
            job = farm.submit(**SPEC).id
            assert_same(outcome(farm, job), undisturbed)
            assert [one for one in farm.jobs.events(job) if one.type == "trouble"] == []
