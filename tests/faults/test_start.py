"""Processes start whether Redis is there or not, and refuse data that they cannot read."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from plateau.errors import ExitCode
from plateau.farm.model.versions import LAYOUT
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.support.long_tests import rare
from tests.support.processes.commands import Command, starting
from tests.support.until import until

READY = r"listens at (http://127\.0\.0\.1:\d+)"
OTHER = str(LAYOUT + 1)
REFUSAL = f"the data in Redis has layout {OTHER}"
PROCESSES = (("api", "--port", "0"), ("monitor",), ("worker",))
ONE_OF_THEM = [PROCESSES[0], *rare(*((one,) for one in PROCESSES[1:]))]

Run = Callable[..., Command]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    """Starts commands whose Redis is to be in the folder ``redis``."""
    places = {
        "PLATEAU_REDIS_URL": f"unix://{tmp_path}/redis/redis.sock",
        "PLATEAU_BLOBS": str(tmp_path / "blobs"),
    }
    yield from starting(lambda *arguments: Command(*arguments, folder=tmp_path, **places))


@pytest.fixture
def redis_comes(tmp_path: Path) -> Iterator[Callable[[], EmbeddedRedis]]:
    servers: list[EmbeddedRedis] = []

    def come() -> EmbeddedRedis:
        servers.append(EmbeddedRedis(tmp_path / "redis"))
        return servers[-1]

    yield come
    for server in servers:
        server.stop()


def test_a_data_folder_of_another_version_is_refused(tmp_path: Path) -> None:
    # Given a data folder that another Plateau has used
    server = EmbeddedRedis(tmp_path / "data" / "redis")
    with connect(server.url, 120.0) as client:
        client.set(keys.SCHEMA, OTHER)
    server.stop()
    # Then this one says so in a line, and leaves it as it is
    with Command("up", "--workers", "0", "--port", "0", folder=tmp_path) as command:
        assert command.exit_code() == ExitCode.INCOMPATIBLE
        command.is_gone()
    assert REFUSAL in command.said
    assert "install the Plateau that wrote it, or choose another PLATEAU_DATA" in command.said
    assert len(command.said.splitlines()) == 1
    server = EmbeddedRedis(tmp_path / "data" / "redis")
    with connect(server.url, 120.0) as client:
        assert client.keys("*") == [keys.SCHEMA]
        assert client.get(keys.SCHEMA) == OTHER
    server.stop()


@pytest.mark.long
@pytest.mark.parametrize("arguments", PROCESSES)
def test_each_process_refuses_what_is_too_new(
    arguments: tuple[str, ...], run: Run, redis_comes: Callable[[], EmbeddedRedis]
) -> None:
    with connect(redis_comes().url, 120.0) as client:
        client.set(keys.SCHEMA, OTHER)
    command = run(*arguments)
    assert command.exit_code() == ExitCode.INCOMPATIBLE
    assert REFUSAL in command.said
    assert "Traceback" not in command.said


@pytest.mark.parametrize("arguments", ONE_OF_THEM)
def test_each_process_waits_for_redis(
    arguments: tuple[str, ...], run: Run, redis_comes: Callable[[], EmbeddedRedis]
) -> None:
    # Given a process that was started before its Redis
    command = run(*arguments)
    command.wait_for("Redis cannot be reached")
    # If that comes
    server = redis_comes()
    # Then the process goes on, and marks the layout
    with connect(server.url, 120.0) as client:
        until(lambda: client.get(keys.SCHEMA) == str(LAYOUT))
    assert command.process.poll() is None


@pytest.mark.parametrize("arguments", ONE_OF_THEM)
def test_each_process_refuses_what_comes_late_and_is_too_new(
    arguments: tuple[str, ...], run: Run, redis_comes: Callable[[], EmbeddedRedis], tmp_path: Path
) -> None:
    before = redis_comes()
    with connect(before.url, 120.0) as client:
        client.set(keys.SCHEMA, OTHER)
    before.stop()
    command = run(*arguments)
    command.wait_for(READY if arguments[0] == "api" else "trying again")
    redis_comes()
    assert command.exit_code() == ExitCode.INCOMPATIBLE
    assert REFUSAL in command.said
    assert "Traceback" not in command.said


@pytest.mark.parametrize("arguments", ONE_OF_THEM)
def test_each_process_can_be_stopped_while_it_waits(arguments: tuple[str, ...], run: Run) -> None:
    command = run(*arguments)
    command.wait_for(READY if arguments[0] == "api" else "trying again")
    command.process.send_signal(signal.SIGTERM)
    assert command.exit_code() == 0


def test_an_api_answers_without_redis(run: Run, redis_comes: Callable[[], EmbeddedRedis]) -> None:
    url = run("api", "--port", "0").wait_for(READY)
    with httpx.Client(base_url=url, verify=False, trust_env=False, timeout=60) as http:
        assert http.get("/healthz").status_code == 200
        assert http.get("/v1/jobs").status_code == 503
        redis_comes()
        until(lambda: http.get("/readyz").status_code == 200)
        assert http.get("/v1/jobs").status_code == 200
