"""The sign of life of a process that probes look at."""

from pathlib import Path

from tests.support.processes.commands import Command
from tests.support.until import until


def test_a_process_that_is_started_again_removes_that_of_the_one_before(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    alive.touch()
    settings = {
        "PLATEAU_REDIS_URL": f"unix://{tmp_path}/nobody.sock",
        "PLATEAU_BLOBS": str(tmp_path / "blobs"),
        "PLATEAU_ALIVE_FILE": str(alive),
    }
    with Command("worker", folder=tmp_path, **settings) as worker:
        until(lambda: not alive.exists(), 120, lambda: worker.said)
        # And shows none before Redis has answered once
        worker.wait_for("Redis")
        assert not alive.exists()
