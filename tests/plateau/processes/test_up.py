"""`plateau up`: a tree of processes that stands by itself and leaves nothing behind."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

from plateau.client import Client
from plateau.worker.confinement.capabilities import drop_capabilities
from tests.support.long_tests import rare
from tests.support.processes.commands import Command, starting
from tests.support.scenes.bundles import scene
from tests.support.until import until

Up = Callable[..., Command]
#: Redis, API, monitor, and the process in which the API checks scenes.
FAMILY = 4
READY = r"listens at (http://127\.0\.0\.1:\d+)"


def started(folder: Path, *arguments: str, **more: Any) -> Command:
    # No worker: few of these need one, and it takes the longest to start
    return Command("up", "--workers", "0", "--port", "0", *arguments, folder=folder, **more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the shared service runs."""
    return tmp_path_factory.mktemp("up")


@pytest.fixture(scope="module")
def service(folder: Path) -> Iterator[Command]:
    """A service that tests share; the last of them stops it."""
    with started(folder) as command:
        yield command


@pytest.fixture
def up(folder: Path) -> Iterator[Up]:
    """Starts another in the folder of the shared one, or elsewhere; none outlives the test."""

    def start(*arguments: str, folder: Path = folder, **more: Any) -> Command:
        return started(folder, *arguments, **more)

    yield from starting(start)


@pytest.fixture(scope="module")
def box(folder: Path) -> Path:
    path = folder / "box.xml"
    path.write_bytes(scene())
    return path


#: Another process of the same user, without root's powers: which environments show it a secret?
PEEK = """
import sys
from pathlib import Path
from plateau.worker.confinement.capabilities import drop_capabilities

drop_capabilities()
for pid in sys.argv[1:]:
    try:
        if b"swordfish" in Path(f"/proc/{pid}/environ").read_bytes():
            print(Path(f"/proc/{pid}/cmdline").read_text())
    except OSError:  # it is hidden, or has ended
        pass
"""


@pytest.mark.skipif(sys.platform != "linux", reason="there is no /proc elsewhere")
def test_its_processes_hide_its_credentials_and_share_the_machines_memory(
    up: Up, tmp_path: Path
) -> None:
    # Given a service with credentials in its environment, and with no more powers than who peeks:
    # those of root's would keep the others out by themselves
    options = {"prepare": drop_capabilities, "AWS_SECRET_ACCESS_KEY": "swordfish"}
    service = up("--workers", "2", folder=tmp_path, **options)

    def limits() -> list[int]:
        found = []
        for one in service.family():
            with suppress(psutil.NoSuchProcess):
                if "plateau.worker.child" in one.cmdline():
                    found.append(one.rlimit(psutil.RLIMIT_AS)[1])
        return [most for most in found if most != psutil.RLIM_INFINITY]

    # Once both workers have a child that has set its limits
    until(lambda: len(limits()) == 2, 120)
    total = psutil.virtual_memory().total
    assert 0.79 * total < sum(limits()) <= 0.8 * total
    # Then neither the command nor anything that it has started shows them, once it runs
    ones = [str(service.process.pid), *(str(one.pid) for one in service.family())]
    assert len(ones) >= 5  # Redis, API, monitor and workers
    peek = [sys.executable, "-c", PEEK, *ones]
    until(lambda: not subprocess.check_output(peek))


def test_a_second_one_on_its_folder_is_refused(service: Command, up: Up) -> None:
    url = service.wait_for(READY)
    second = up()
    assert second.exit_code() == 1
    assert f"already runs there at {url}" in second.said
    assert len(second.said.splitlines()) == 1


def test_a_port_that_is_taken_is_said_to_be(service: Command, up: Up, tmp_path: Path) -> None:
    port = service.wait_for(READY).rpartition(":")[2]
    # If it is tried again, it tells of this time alone
    for times in (1, 2):
        second = up("--port", port, folder=tmp_path)
        assert second.exit_code() == 1
        second.is_gone()
        log = (tmp_path / "data" / "logs" / "api.log").read_text()
        assert log.count("cannot listen on 127.0.0.1") == times
        assert second.said.count("cannot listen on 127.0.0.1") == 1
        assert "give another --port" in second.said


@pytest.mark.parametrize("name", ["api", *rare("monitor")])
def test_a_process_that_dies_is_started_again(service: Command, name: str) -> None:
    url = service.wait_for(READY)
    service.member(name).kill()
    service.wait_for(f"{name} was ended by SIGKILL; starting it again")
    until(lambda: len(service.family()) == FAMILY)
    with Client(url, patience_s=120) as client:  # the API has its port again
        assert list(client.all_jobs()) == []


def test_redis_is_started_again_with_all_that_it_had(service: Command, box: Path) -> None:
    with Client(service.wait_for(READY), patience_s=120) as client:
        job = client.submit(box)
        next(one for one in service.family() if "redis" in one.name()).kill()
        service.wait_for("Redis was ended by SIGKILL; starting it again")
        until(lambda: len(service.family()) == FAMILY)
        assert client.job(job.id).id == job.id


def test_logs_are_begun_anew_where_they_are_too_long(service: Command, folder: Path) -> None:
    # Given a service whose logs grow and grow
    service.wait_for(READY)
    logs = folder / "data" / "logs"
    api, redis_log = logs / "api.log", next((folder / "data").rglob("redis.log"))
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
    service.member("api").terminate()
    until(lambda: api.stat().st_size > 0)
    assert "\0" not in api.read_text()


#: On a busy disk, the monitor of a killed tree takes a while to leave.
PATIENT = (
    "from plateau.processes import data_folder; data_folder._LEAVING_S = 100.0; "
    "from plateau.commands import main; main()"
)


def test_its_jobs_survive_however_it_ends(
    service: Command, up: Up, box: Path, folder: Path
) -> None:
    # Given a service with a job
    with Client(service.wait_for(READY)) as client:
        job = client.submit(box)
    # It says how another worker joins, and where its data is
    assert re.search(r"PLATEAU_REDIS_URL=\S+ PLATEAU_BLOBS=\S+ plateau worker", service.said)
    assert str(folder / "data") in service.said
    until(lambda: len(service.family()) == FAMILY)
    # If it is asked to stop, then it does, with nothing left behind
    service.process.send_signal(signal.SIGTERM)
    assert service.exit_code() == 0
    service.is_gone()
    assert list(service.temporary.iterdir()) == []
    # And the next one has the job
    second = up()
    with Client(second.wait_for(READY)) as client:
        assert client.job(job.id).scene_sha256 == job.scene_sha256
    # If that is killed, then all of it goes, and a third may start at once: it waits till they left
    second.family()
    second.process.kill()
    second.process.wait()
    third = up(program=("-c", PATIENT))
    second.is_gone()
    with Client(third.wait_for(READY)) as client:
        assert client.job(job.id).id == job.id
