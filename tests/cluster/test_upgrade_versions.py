"""A process of another version is refused, in words, and changes nothing."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.errors import ExitCode
from plateau.farm.model import versions
from plateau.farm.redis import keys
from tests.support.farms.faulty_farm import SPEC, FaultyFarm
from tests.support.until import until

#: What is changed of a Plateau of the next layout, which is made up.
NEXT_LAYOUT = {"plateau.farm.model.versions:LAYOUT": versions.LAYOUT + 1}


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path, cache) as farm:
        yield farm


def test_processes_of_another_version_end_and_the_farm_works_on(
    farm: FaultyFarm, capfd: pytest.CaptureFixture[str]
) -> None:
    # Given a farm at work
    farm.start("monitor")
    farm.start("worker")
    job = farm.submit(**SPEC)
    # If processes of the next layout are started beside it
    for role in (("api", "--port", "0"), ("monitor",), ("worker",)):
        other = farm.start_changed(*role, set=NEXT_LAYOUT)
        # Then each names both versions, and ends
        assert other.wait(120) == ExitCode.INCOMPATIBLE
        farm.processes.remove(other)
        said = capfd.readouterr().err
        assert f"has layout {versions.LAYOUT}, and this Plateau" in said
        assert f"works with layout {versions.LAYOUT + 1}" in said
    assert farm.client.wait(job.id, timeout_s=200).state == "converged"


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
