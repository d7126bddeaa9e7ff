"""Processes of different versions meet: those that fit work together, others say why not."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest

from plateau.exit_codes import ExitCode
from plateau.farm.model import versions
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from tests.support.farms.faulty_farm import SPEC, FaultyFarm
from tests.support.faults.invariants import assert_same, outcome
from tests.support.until import until

#: What is changed of a Plateau of the next layout, which is made up.
NEXT_LAYOUT = {
    "plateau.farm.model.versions:LAYOUT": versions.LAYOUT + 1,
    "plateau.farm.ledger.schema:_MIGRATIONS": {
        str(versions.LAYOUT): "redis.call('SET', PREFIX .. 'brought', 'forward')"
    },
}


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path, cache) as farm:
        yield farm


def speaks(oldest: int, newest: int) -> dict[str, Any]:
    """What is changed of a Plateau that speaks these protocols, counted from this one's."""
    return {
        "plateau.farm.model.versions:OLDEST": versions.NEWEST + oldest,
        "plateau.farm.model.versions:NEWEST": versions.NEWEST + newest,
    }


def ends_as_one_that_does_not_fit(farm: FaultyFarm, process: "subprocess.Popen[bytes]") -> None:
    """Assert that the process ends as one that does not fit, soon."""
    assert process.wait(120) == ExitCode.INCOMPATIBLE
    farm.processes.remove(process)


def test_a_worker_that_is_too_old_or_too_new_is_not_let_in(
    farm: FaultyFarm, capfd: pytest.CaptureFixture[str]
) -> None:
    # Given a farm whose API speaks one protocol, a monitor that speaks another is not let in
    job = farm.submit(**SPEC)
    ends_as_one_that_does_not_fit(farm, farm.start_changed("monitor", set=speaks(+2, +3)))
    (monitor,) = farm.client.refused()
    assert monitor.role == "monitor"
    assert "It is too new: upgrade the farm's monitors and APIs" in monitor.why
    # Nor is a worker, and it says so as it ends
    ends_as_one_that_does_not_fit(farm, farm.start_changed("worker", set=speaks(-1, -1)))
    said = capfd.readouterr().err
    assert f"the farm's monitors and APIs speak protocol {versions.NEWEST}" in said
    assert "It is too old: install Plateau" in said
    assert "Traceback" not in said
    assert {one.role for one in farm.client.refused()} == {"monitor", "worker"}
    # `plateau workers` tells of them
    listed = subprocess.run(
        [sys.executable, "-m", "plateau", "workers", "--url", farm.url],
        capture_output=True,
        text=True,
        env=farm.environment,
        check=True,
    )
    assert "plateau: the worker of " in listed.stderr
    # And neighbours of this version work with it
    farm.start_changed("monitor", set=speaks(0, +1))
    farm.start_changed("worker", set=speaks(-1, 0))
    assert farm.client.wait(job.id, timeout_s=200).state == "converged"


def test_a_worker_may_wait_for_the_farm_to_be_upgraded(farm: FaultyFarm) -> None:
    job = farm.submit(**SPEC)
    waits = {"plateau.farm.ledger.members:_UPGRADE_S": 0.5}
    farm.environment["PLATEAU_WHEN_REFUSED"] = "wait"
    farm.start("monitor")
    until(lambda: farm.redis_client.zcard(keys.MONITORS))
    farm.start_changed("worker", set={**speaks(+1, +2), **waits})

    def worker() -> Worker | None:
        return next(iter(farm.client.workers()), None)

    # Given a worker that came too early: it lives, takes no work, and says why
    until(lambda: (found := worker()) is not None and found.trouble)
    found = worker()
    assert found is not None
    assert "It is too new" in (found.trouble or "")
    # If the farm's monitor and API are replaced
    for process in farm.processes[:2]:
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
    del farm.processes[:2]
    farm.start_changed("monitor", set=speaks(0, +1))
    # Then it works
    until(lambda: farm.jobs.get(job.id).finished_at is not None, 200)
    assert farm.jobs.get(job.id).state == "converged"


def test_a_new_layout_waits_until_the_old_processes_have_gone(
    farm: FaultyFarm, form: Literal["short", "long"], capfd: pytest.CaptureFixture[str]
) -> None:
    # Given a farm at work
    farm.start("monitor")
    old = farm.start("worker")
    job = farm.submit(**SPEC)
    until(lambda: farm.client.workers())
    # If a worker of the next layout is started beside it
    new = farm.start_changed("worker", set=NEXT_LAYOUT)
    # Then it changes nothing, says who is in its way, and gives up after a while
    ends_as_one_that_does_not_fit(farm, new)
    said = capfd.readouterr().err
    assert "This one cannot migrate the data while these processes work with it as it is" in said
    for role in ("worker", "monitor", "API"):
        assert f"{role} " in said
    assert farm.redis_client.get(keys.SCHEMA) == str(versions.LAYOUT)
    assert farm.client.wait(job.id, timeout_s=200).state == "converged"
    if form == "short":
        return
    # If all are stopped but one, which is frozen for longer than it is taken for alive
    old.send_signal(signal.SIGSTOP)
    for process in [one for one in farm.processes if one is not old]:
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
        farm.processes.remove(process)
    farm.start_changed("monitor", set=NEXT_LAYOUT)
    until(lambda: farm.redis_client.get(keys.SCHEMA) == str(versions.LAYOUT + 1))
    # Then it can do nothing when it wakes up, and ends
    old.send_signal(signal.SIGCONT)
    ends_as_one_that_does_not_fit(farm, old)
    assert "a newer Plateau has migrated it" in capfd.readouterr().err
    # And one that is started then is refused at once
    ends_as_one_that_does_not_fit(farm, farm.start("worker"))


@pytest.mark.long_form
def test_an_older_layout_is_brought_forward_in_mid_job(farm: FaultyFarm) -> None:
    # Given a farm in the middle of a job, and what comes of such a job
    spec = {**SPEC, "max_spp": 10_000}
    old = [farm.start("monitor"), farm.start("worker")]
    undisturbed = outcome(farm, farm.submit(**spec).id)
    job = farm.submit(**spec)
    until(lambda: farm.client.job(job.id).points >= 2, 200)
    before = farm.client.job(job.id)
    # If all of its processes are stopped, and those of the next layout are started
    for process in [*old, farm.processes[0]]:
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
        farm.processes.remove(process)
    farm.start_changed("api", "--port", farm.url.rpartition(":")[2], set=NEXT_LAYOUT)
    for role in ("monitor", "worker"):
        farm.start_changed(role, set=NEXT_LAYOUT)
    until(lambda: farm.redis_client.get(keys.SCHEMA) == str(versions.LAYOUT + 1))
    # Then the migration was run, and they go on where the others were
    assert farm.redis_client.get(keys.PREFIX + "brought") == "forward"
    done = outcome(farm, job.id)
    assert done.job.spp >= before.spp
    # To the image that the others would have made
    assert_same(done, undisturbed)
