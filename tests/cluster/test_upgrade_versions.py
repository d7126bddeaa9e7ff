"""A process of another version changes nothing; tests/faults/test_start.py shows its refusal."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.errors import ExitCode
from plateau.farm.model import versions
from plateau.farm.redis import keys
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.until import until


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path, cache, plain=True) as farm:
        yield farm


@pytest.mark.parametrize("role", ["monitor", "worker"])
def test_a_process_that_was_frozen_can_do_nothing_to_other_data(
    farm: FaultyFarm, capfd: pytest.CaptureFixture[str], role: str
) -> None:
    members = {"monitor": keys.MONITORS, "worker": keys.WORKERS}[role]
    old = farm.start(role)
    until(lambda: farm.redis_client.zcard(members))
    # If Redis has the data of another version when it wakes up
    old.send_signal(signal.SIGSTOP)
    farm.redis_client.set(keys.SCHEMA, versions.LAYOUT + 1)
    old.send_signal(signal.SIGCONT)
    # Then it ends
    assert old.wait(120) == ExitCode.INCOMPATIBLE
    farm.processes.remove(old)
    assert f"has layout {versions.LAYOUT + 1}" in capfd.readouterr().err
