"""No process that a test has started outlives the process of the tests."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from tests.support.long_tests import rare
from tests.support.until import until

ROOT = Path(__file__).parents[1]


@pytest.fixture
def short_path() -> Iterator[Path]:
    """For a run of tests within this one: sockets lie in it, see unix(7)."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        yield Path(folder) / "t"


@pytest.mark.parametrize(
    ("killed_by", "options"), [(signal.SIGKILL, ()), *rare((signal.SIGTERM, ("-n", "1")))]
)
def test_a_pytest_that_is_killed_leaves_nothing_behind(
    tmp_path: Path, short_path: Path, killed_by: signal.Signals, options: tuple[str, ...]
) -> None:
    # Given a run of tests whose processes are all there
    ready, said = tmp_path / "ready", tmp_path / "said"
    file = "tests/support/processes/abandoned.py"
    command = [sys.executable, "-m", "pytest", "-q", file, *options]
    environment = {**os.environ, "PLATEAU_TEST_IS_READY": str(ready)}
    for name in ("PYTEST_XDIST_WORKER", "PYTEST_XDIST_WORKER_COUNT", "PYTEST_ADDOPTS"):
        environment.pop(name, None)
    with said.open("wb") as log:
        run = subprocess.Popen(
            [*command, f"--basetemp={short_path}"],
            cwd=ROOT,
            env=environment,
            stdout=log,
            stderr=log,
        )
    until(lambda: ready.exists() or run.poll() is not None)
    assert run.poll() is None, said.read_text()
    started = _processes_of(run, ready)
    names = ""
    for one in started:
        with suppress(psutil.NoSuchProcess):  # it has just ended
            names += " ".join(["", *one.cmdline()])
    for part in ("redis-server", "sleep(600)", "sleep 601", "multiprocessing"):
        assert part in names
    # When it is killed, so that no fixture ends
    run.send_signal(killed_by)
    run.wait(60)
    # Then all that it had started goes by itself
    _, left = psutil.wait_procs(started, timeout=60)
    for one in left:
        one.kill()
    assert left == []


def _processes_of(run: subprocess.Popen[bytes], ready: Path) -> list[psutil.Process]:
    """What it has started, and daemons of that."""
    found = psutil.Process(run.pid).children(recursive=True)
    for one in psutil.process_iter():
        with suppress(psutil.Error):
            if one.environ().get("PLATEAU_TEST_IS_READY") == str(ready):
                found.append(one)
    return [one for one in found if one.pid != run.pid]
