"""Processes of different versions meet: those that fit work together, others say why not."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import pytest
from PIL import Image

from plateau.client import Client
from plateau.exit_codes import ExitCode
from plateau.farm.model import versions
from plateau.farm.model.job import Worker
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from tests.support.faulty_farm import SPEC, FaultyFarm
from tests.support.invariants import assert_same, outcome
from tests.support.real_farm import BOX, until

ROOT = Path(__file__).parents[2]

#: A commit of layout 3: neither its scripts nor its APIs say or look who fits.
LAYOUT_3 = "ee3ce5bc370bb0976568c1314ca2510878cacb94"

NEXT_LAYOUT = {
    "plateau.farm.model.versions:LAYOUT": versions.LAYOUT + 1,
    "plateau.farm.ledger.schema:VERSION": versions.LAYOUT + 1,
    "plateau.farm.ledger.schema:_MIGRATIONS": {str(versions.LAYOUT): ""},
}


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[FaultyFarm]:
    with FaultyFarm(tmp_path, cache) as farm:
        yield farm


def speaks(oldest: int, newest: int) -> dict[str, Any]:
    """What is changed of a Plateau that speaks these protocols."""
    return {
        "plateau.farm.model.versions:OLDEST": oldest,
        "plateau.farm.model.versions:NEWEST": newest,
    }


def ends_as_one_that_does_not_fit(farm: FaultyFarm, process: "subprocess.Popen[bytes]") -> None:
    """Assert that the process ends as one that does not fit, soon."""
    assert process.wait(120) == ExitCode.INCOMPATIBLE
    farm.processes.remove(process)


def test_a_worker_that_is_too_old_or_too_new_is_not_let_in(
    farm: FaultyFarm, capfd: pytest.CaptureFixture[str]
) -> None:
    # Given a farm whose API speaks protocol 1, a monitor that speaks another is not let in
    job = farm.submit(**SPEC)
    ends_as_one_that_does_not_fit(farm, farm.start_changed("monitor", set=speaks(3, 4)))
    (monitor,) = farm.client.refused()
    assert monitor.role == "monitor"
    assert "It is too new: upgrade the farm's monitors and APIs" in monitor.why
    # Nor is a worker, and it says so as it ends
    ends_as_one_that_does_not_fit(farm, farm.start_changed("worker", set=speaks(0, 0)))
    said = capfd.readouterr().err
    assert "the farm's monitors and APIs speak protocol 1" in said
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
    farm.start_changed("monitor", set=speaks(1, 2))
    farm.start_changed("worker", set=speaks(0, 1))
    assert farm.client.wait(job.id, timeout_s=200).state == "converged"


def test_a_worker_may_wait_for_the_farm_to_be_upgraded(farm: FaultyFarm) -> None:
    job = farm.submit(**SPEC)
    waits = {"plateau.farm.ledger.members:_UPGRADE_S": 0.5}
    farm.environment["PLATEAU_WHEN_REFUSED"] = "wait"
    farm.start("monitor")
    until(lambda: farm.redis_client.zcard(keys.MONITORS))
    farm.start_changed("worker", set={**speaks(2, 3), **waits})

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
    farm.start_changed("monitor", set=speaks(1, 2))
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


class OlderPlateau:
    """This repository as it was at a commit, and processes of it."""

    def __init__(self, folder: Path, commit: str, environment: dict[str, str]) -> None:
        self._folder = folder
        self._environment = {**environment, "PYTHONPATH": str(folder)}
        self._processes: list[subprocess.Popen[bytes]] = []
        folder.mkdir()
        archive = subprocess.run(
            ["git", "archive", commit], cwd=ROOT, check=True, capture_output=True
        )
        subprocess.run(["tar", "-x"], cwd=folder, check=True, input=archive.stdout)

    def start(self, *arguments: str, passed: tuple[int, ...] = ()) -> None:
        self._processes.append(
            subprocess.Popen(
                [sys.executable, "-m", "plateau", *arguments],
                cwd=self._folder,
                env=self._environment,
                pass_fds=passed,
                start_new_session=True,
            )
        )

    def start_api(self) -> str:
        reads, writes = os.pipe()
        self.start("api", "--port", "0", "--ready-fd", str(writes), passed=(writes,))
        os.close(writes)
        with os.fdopen(reads) as pipe:
            return pipe.readline().strip()

    def stop(self) -> None:
        for process in self._processes:
            process.send_signal(signal.SIGTERM)
        for process in self._processes:
            process.wait(300)
        self._processes = []


def history_has(commit: str) -> bool:
    """Whether this is a clone with that commit, neither a copy of its files nor a shallow clone."""
    asked = ["git", "cat-file", "-e", f"{commit}^{{commit}}"]
    return subprocess.run(asked, cwd=ROOT, capture_output=True, check=False).returncode == 0


def test_an_older_plateau_is_upgraded_in_mid_job(
    tmp_path: Path, cache: Path, form: Literal["short", "long"]
) -> None:
    if form == "short" or not history_has(LAYOUT_3):
        print("left out: it takes the long form, and the repository's history")
        return
    # Given a farm of a Plateau that knew nothing of all this, in the middle of a job
    redis, blobs = EmbeddedRedis(tmp_path / "before" / "redis"), tmp_path / "blobs"
    settings = {
        "PLATEAU_REDIS_URL": redis.url,
        "PLATEAU_BLOBS": str(blobs),
        "PLATEAU_CACHE": str(cache),
        "PLATEAU_THREADS": "1",
    }
    old = OlderPlateau(tmp_path / "old", LAYOUT_3, {**os.environ, **settings})
    try:
        with Client(old.start_api()) as client:
            old.start("monitor")
            old.start("worker")
            job = client.submit(BOX, JobSpec.model_validate({**SPEC, "max_spp": 10_000}))
            # (its monitor compiles the metric anew, where it lies now)
            until(lambda: client.job(job.id).points >= 2, 500)
            # If a process of today is started, it says who is in its way
            beside = subprocess.run(
                [sys.executable, "-m", "plateau", "worker"],
                env={**os.environ, **settings},
                capture_output=True,
                text=True,
                check=False,
                timeout=200,
            )
            assert beside.returncode == ExitCode.INCOMPATIBLE
            assert "the data in Redis has layout 3" in beside.stderr
            assert re.search(
                r"as it is, and could not any more: worker \S+, monitor", beside.stderr
            )
            before = client.job(job.id)
    finally:
        old.stop()
        redis.stop()
    # And when all of them are stopped, those of today go on where they were
    with FaultyFarm(tmp_path / "before", cache, blobs=blobs) as farm:
        farm.start("monitor")
        farm.start("worker")
        done = outcome(farm, job.id)
        assert done.job.spp >= before.spp
        # To the image that they would have made alone
        again = outcome(farm, farm.submit(**{**SPEC, "max_spp": 10_000}).id)
        pictures = [Image.open(BytesIO(one.difference)).tobytes() for one in (done, again)]
        assert pictures[0] == pictures[1]  # though versions may compress them otherwise
        assert_same(replace(done, difference=again.difference), again)
