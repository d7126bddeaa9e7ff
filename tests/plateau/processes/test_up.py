"""`plateau up`: a tree of processes that stands by itself and leaves nothing behind."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from plateau.client import Client
from plateau.worker.confinement.capabilities import drop_capabilities
from tests.support.long_tests import rare
from tests.support.processes.commands import Command
from tests.support.scenes.bundles import scene
from tests.support.until import until

Up = Callable[..., Command]
#: Redis, API, monitor, and the process in which the API checks scenes.
FAMILY = 4
READY = r"listens at (http://127\.0\.0\.1:\d+)"


@pytest.fixture
def up(tmp_path: Path) -> Iterator[Up]:
    started: list[Command] = []

    def start(
        *arguments: str, prepare: Callable[[], object] | None = None, **environment: str
    ) -> Command:
        # No worker: none of this needs one, and it takes the longest to start
        arguments = ("up", "--workers", "0", "--port", "0", *arguments)
        started.append(Command(*arguments, folder=tmp_path, prepare=prepare, **environment))
        return started[-1]

    yield start
    for command in started:
        command.end()


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.xml"
    path.write_bytes(scene())
    return path


@pytest.mark.parametrize("number", [signal.SIGTERM, *rare(signal.SIGINT)])
def test_it_stops_in_order_and_its_jobs_survive(
    up: Up, box: Path, tmp_path: Path, number: signal.Signals
) -> None:
    # Given a service with a job
    first = up()
    with Client(first.wait_for(READY)) as client:
        job = client.submit(box)
    # It says how another worker joins, and where its data is
    assert re.search(r"PLATEAU_REDIS_URL=\S+ PLATEAU_BLOBS=\S+ plateau worker", first.said)
    assert str(tmp_path / "data") in first.said
    assert len(first.family()) == FAMILY
    # If it is asked to stop
    first.process.send_signal(number)
    # Then it does, with nothing left behind
    assert first.exit_code() == 0
    first.is_gone()
    assert list(first.temporary.iterdir()) == []
    # And the next one has the job
    second = up()
    with Client(second.wait_for(READY)) as client:
        assert client.job(job.id).scene_sha256 == job.scene_sha256


#: Another process of the same user, without root's powers: which environments show it a secret?
PEEK = """
import sys
from pathlib import Path
from plateau.worker.confinement.capabilities import drop_capabilities

drop_capabilities()
for pid in sys.argv[1:]:
    try:
        shown = b"swordfish" in Path(f"/proc/{pid}/environ").read_bytes()
    except PermissionError:
        shown = False
    if shown:
        print(Path(f"/proc/{pid}/cmdline").read_text())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="there is no /proc elsewhere")
def test_none_of_its_processes_shows_another_its_credentials(up: Up) -> None:
    # Given a service with credentials in its environment, and with no more powers than who peeks:
    # those of root's would keep the others out by themselves
    service = up("--workers", "1", prepare=drop_capabilities, AWS_SECRET_ACCESS_KEY="swordfish")
    with Client(service.wait_for(READY)) as client:
        until(lambda: bool(client.workers()), 120)
    # Then neither the command nor anything that it has started shows them, once it runs
    ones = [str(service.process.pid), *(str(one.pid) for one in service.family())]
    assert len(ones) >= 5  # Redis, API, monitor and worker
    peek = [sys.executable, "-c", PEEK, *ones]
    until(lambda: not subprocess.check_output(peek), 60)


@pytest.mark.skipif(sys.platform != "linux", reason="others' limits are seen on Linux alone")
def test_its_render_children_share_the_machines_memory(up: Up) -> None:
    service = up("--workers", "2")

    def limits() -> list[int]:
        found = []
        for one in service.family():
            with suppress(psutil.NoSuchProcess):
                if "plateau.worker.child" in one.cmdline():
                    found.append(one.rlimit(psutil.RLIMIT_AS)[1])
        return [most for most in found if most != psutil.RLIM_INFINITY]

    # Once both have a child that has set its limits
    until(lambda: len(limits()) == 2, 120)
    total = psutil.virtual_memory().total
    assert 0.79 * total < sum(limits()) <= 0.8 * total


def test_a_second_one_on_its_folder_is_refused(up: Up) -> None:
    first = up()
    url = first.wait_for(READY)
    second = up()
    assert second.exit_code() == 1
    assert f"already runs there at {url}" in second.said
    assert len(second.said.splitlines()) == 1


def test_a_port_that_is_taken_is_said_to_be(up: Up, tmp_path: Path) -> None:
    first = up()
    port = first.wait_for(READY).rpartition(":")[2]
    second = Command("up", "--port", port, folder=tmp_path / "other")
    try:
        assert second.exit_code() == 1
        assert "cannot listen on 127.0.0.1" in second.said
        second.is_gone()
    finally:
        second.end()
    # If it is tried again, it tells of this time alone
    third = Command("up", "--port", port, folder=tmp_path / "other")
    try:
        assert third.exit_code() == 1
        log = (tmp_path / "other" / "data" / "logs" / "api.log").read_text()
        assert log.count("cannot listen on 127.0.0.1") == 2
        assert third.said.count("cannot listen on 127.0.0.1") == 1
    finally:
        third.end()


def test_when_it_is_killed_everything_goes_and_the_next_may_start(up: Up, box: Path) -> None:
    first = up()
    with Client(first.wait_for(READY)) as client:
        job = client.submit(box)
    until(lambda: len(first.family()) == FAMILY, 60)
    first.process.kill()
    second = up()  # at once: it waits until the others have left
    first.is_gone()
    with Client(second.wait_for(READY)) as client:
        assert client.job(job.id).id == job.id


@pytest.mark.parametrize("name", ["api", *rare("monitor")])
def test_a_process_that_dies_is_started_again(up: Up, name: str) -> None:
    command = up()
    url = command.wait_for(READY)
    command.member(name).kill()
    command.wait_for(f"{name} was ended by SIGKILL; starting it again")
    until(lambda: len(command.family()) == FAMILY, 60)
    with Client(url) as client:  # the API has its port again
        assert client.jobs().jobs == []


def test_redis_is_started_again_with_all_that_it_had(up: Up, box: Path) -> None:
    command = up()
    url = command.wait_for(READY)
    with Client(url) as client:
        job = client.submit(box)
        command.family()
        redis_server = next(one for one in command.family() if "redis" in one.name())
        redis_server.kill()
        command.wait_for("Redis was ended by SIGKILL; starting it again")
        until(lambda: len(command.family()) == FAMILY, 60)
        assert client.job(job.id).id == job.id


def test_logs_are_begun_anew_where_they_are_too_long(up: Up, tmp_path: Path) -> None:
    # Given a service whose logs grow and grow
    command = up()
    url = command.wait_for(READY)
    logs = tmp_path / "data" / "logs"
    api, redis_log = logs / "api.log", next((tmp_path / "data").rglob("redis.log"))
    before = api.read_text()
    for log in (api, redis_log):
        with log.open("ab") as file:
            file.write(b"noise\n" * 2_000_000)
    # Then they are short again, and what they had is beside them
    for log in (api, redis_log):
        until(lambda log=log: log.stat().st_size < 10_000, 60)  # type: ignore[misc]
        assert log.with_suffix(".log.1").stat().st_size > 10_000_000
    assert api.with_suffix(".log.1").read_text().startswith(before)
    # And who wrote there goes on to
    command.member("monitor").kill()
    with Client(url) as client:
        assert client.jobs().jobs == []
    command.process.send_signal(signal.SIGTERM)
    assert command.exit_code() == 0
    assert "\0" not in api.read_text()
