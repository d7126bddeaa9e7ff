"""A farm whose workers are Slurm's: they come for a job and leave after it, and nothing is lost.

Real Slurm, two nodes, real signals; Redis, API and monitor run beside it, on a machine of the farm.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from plateau.farm.ledger.totals import take_census
from tests.cluster.support_slurm import NODES, Slurm
from tests.support.farms.real_farm import RealFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.until import until

#: On a busy machine all of it takes many times as long.
pytestmark = pytest.mark.timeout(900)

SCRIPT = Path(__file__).parents[2] / "deploy" / "slurm" / "worker.sbatch"

#: Some seconds of one worker's.
SPEC: dict[str, Any] = {
    "parameters": {"width": 48, "height": 48},
    "step": 200,
    "slice_spp": 50,
    "max_spp": 1600,
    "variant": "scalar_rgb",
    "rule": {"name": "reverse", "window": 5, "epsilon": 1e-9},
}

#: Goes on for as long as a test may.
ENDLESS = SPEC | {"max_spp": 500_000, "rule": {"name": "fixed", "spp": 500_000}}

#: A scaler in a hurry.
HASTY = ("--every", "0.3", "--calm", "2", "--idle", "1", "--cpus", "2")


@pytest.fixture(scope="session")
def slurm(tmp_path_factory: pytest.TempPathFactory, tool: Callable[[str], Path]) -> Iterator[Slurm]:
    with Slurm(tmp_path_factory.mktemp("s"), tool) as cluster:
        yield cluster


@pytest.fixture(scope="session")
def shared_farm(
    tmp_path_factory: pytest.TempPathFactory, cache: Path, slurm: Slurm
) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache, **slurm.environment) as farm:
        yield farm


@pytest.fixture(scope="session")
def undisturbed(shared_farm: RealFarm) -> Outcome:
    """What one worker makes of the job, without Slurm."""
    shared_farm.start("monitor")
    shared_farm.workers(1)
    found = outcome(shared_farm, shared_farm.submit(**SPEC).id)
    shared_farm.stop_all()
    return found


@pytest.fixture
def farm(shared_farm: RealFarm, undisturbed: Outcome, slurm: Slurm) -> Iterator[RealFarm]:
    """The farm with a monitor and no worker; Slurm is empty before and after."""
    shared_farm.start("monitor")
    yield shared_farm
    shared_farm.stop_all()
    slurm.run("scancel", "--user=root")
    until(lambda: not slurm.jobs())
    until(lambda: not shared_farm.client.workers())


class Scaler:
    """A `plateau scale slurm` under way."""

    def __init__(self, farm: RealFarm, logs: Path, *options: str, **environment: str) -> None:
        self._said = logs / f"scaler-{time.monotonic_ns()}.jsonl"
        with self._said.open("wb") as said:
            self.process = subprocess.Popen(
                command(logs, *HASTY, *options),
                env={**farm.environment, **environment},
                stdout=said,
                stderr=subprocess.STDOUT,
            )
        self.logs = logs

    def words(self) -> str:
        """All that it has printed."""
        return self._said.read_text()

    def said(self) -> list[dict[str, Any]]:
        """Its reports."""
        lines = self._said.read_text().splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]

    def end(self, number: signal.Signals = signal.SIGTERM) -> None:
        self.process.send_signal(number)
        assert self.process.wait(60) == 0, self._said.read_text()


def command(logs: Path, *options: str) -> list[str]:
    return [sys.executable, "-m", "plateau", "scale", "slurm", "--logs", str(logs), *options]


@pytest.fixture
def scale(farm: RealFarm, tmp_path: Path) -> Iterator[Callable[..., Scaler]]:
    """Starts scalers; none outlives its test."""
    started: list[Scaler] = []

    def start(*options: str, **environment: str) -> Scaler:
        started.append(Scaler(farm, tmp_path, "--json", *options, **environment))
        return started[-1]

    yield start
    for scaler in started:
        if scaler.process.poll() is None:
            scaler.process.kill()
            scaler.process.wait()


def renders(farm: RealFarm, label: str) -> bool:
    """Whether the worker of a task has a slice in hand, and has committed one before."""
    return any(
        worker.label == f"slurm:{label}" and worker.job is not None and worker.slices_done > 0
        for worker in farm.client.workers()
    )


def test_workers_come_for_a_job_outlive_a_node_and_leave(
    farm: RealFarm, slurm: Slurm, scale: Callable[..., Scaler], undisturbed: Outcome, form: str
) -> None:
    scaler = scale("--max", "2", "--worth", "0.5")
    # Nobody is there without work
    until(lambda: scaler.said() or scaler.process.poll() is not None)
    assert scaler.said()[0]["wanted"] == 0
    assert slurm.jobs() == {}
    # When there is a job, a worker comes to each node
    job = farm.submit(**SPEC)
    until(lambda: len(slurm.jobs("--states=RUNNING")) == 2)
    tasks = list(slurm.jobs())
    assert {slurm.node_of(task) for task in tasks} == set(NODES)
    until(lambda: all(renders(farm, task) for task in tasks))
    # If a node dies in the middle of a slice
    slurm.kill_node(slurm.node_of(tasks[0]))
    done = outcome(farm, job.id)
    # Then the other node has done the rest, and the image is that of one worker
    assert_same(done, undisturbed)
    ledger = farm.jobs.ledger(job.id)
    assert len({record["worker"] for record in ledger.values()}) == 2
    # And with the work the workers leave, by themselves and cleanly
    until(lambda: tasks[1] not in slurm.jobs())
    assert slurm.end_of(tasks[1]) == ("COMPLETED", "0:0")
    asked = [task for report in scaler.said() for task in report["end"]]
    assert asked.count(tasks[1]) == 1
    assert set(asked) <= set(tasks)  # to Slurm the dead node's task ran on for a while
    slurm.start_node(next(node for node in NODES if slurm.states()[node] != "idle"))
    if form == "long":
        # The task that Slurm starts again on that node finds nothing to do, and leaves too
        until(lambda: not slurm.jobs())
    scaler.end(signal.SIGINT)


class TestAWorker:
    """One task, submitted by hand: `sbatch --array=1-1 deploy/slurm/worker.sbatch`."""

    pytestmark = pytest.mark.long_form

    @pytest.fixture
    def task(self, farm: RealFarm, slurm: Slurm, tmp_path: Path) -> Callable[..., str]:
        """Submits it, and returns its id."""

        def submit(*options: str) -> str:
            array = slurm.run(
                "sbatch",
                "--parsable",
                "--array=1-1",
                "--cpus-per-task=1",
                "--mem=600M",
                f"--output={tmp_path}/plateau-%A_%a.log",
                *options,
                str(SCRIPT),
                **{**farm.environment, "PLATEAU_PYTHON": sys.executable, "PLATEAU_THREADS": ""},
            )
            return f"{array}_1"

        return submit

    @staticmethod
    def troubles(farm: RealFarm, job_id: str) -> set[str]:
        return {entry.what for entry in farm.jobs.log(job_id) if entry.what != "committed"}

    @pytest.mark.parametrize(
        "options", [(), ("--full", "--signal=TERM"), ("--batch", "--signal=TERM")]
    )
    def test_gives_its_slice_back_whichever_way_it_is_told(
        self,
        options: tuple[str, ...],
        farm: RealFarm,
        slurm: Slurm,
        task: Callable[..., str],
        undisturbed: Outcome,
    ) -> None:
        first = task()
        job = farm.submit(**SPEC)
        until(lambda: renders(farm, first))
        assert farm.client.workers()[0].threads == 1
        # Without an option all its processes are told, the render child too
        slurm.run("scancel", *options, first)
        until(lambda: first not in slurm.jobs())
        assert slurm.end_of(first)[1].startswith("0:")
        until(lambda: not farm.client.workers())
        assert self.troubles(farm, job.id) <= {"handed-back"}
        task()
        assert_same(outcome(farm, job.id), undisturbed)

    @pytest.mark.parametrize("how", ["requeued", "pushed aside"])
    def test_comes_back_when_slurm_takes_its_machine_for_a_while(
        self,
        how: str,
        farm: RealFarm,
        slurm: Slurm,
        task: Callable[..., str],
        undisturbed: Outcome,
    ) -> None:
        only = task()
        job = farm.submit(**SPEC)
        until(lambda: renders(farm, only))
        (before,) = farm.client.workers()
        if how == "requeued":
            slurm.run("scontrol", "requeue", only)
        else:
            urgent = ("--partition=urgent", "--exclusive", "--nodes=2", "--wrap=sleep 3")
            slurm.run("sbatch", *urgent, "--output=/dev/null")
        until(lambda: any(one.id != before.id for one in farm.client.workers()))
        assert_same(outcome(farm, job.id), undisturbed)
        assert self.troubles(farm, job.id) <= {"handed-back"}
        (after,) = farm.client.workers()
        assert after.label == before.label == f"slurm:{only}"
        assert {one["worker"] for one in farm.jobs.ledger(job.id).values()} == {before.id, after.id}

    def test_leaves_before_its_time_is_over(
        self, farm: RealFarm, slurm: Slurm, task: Callable[..., str]
    ) -> None:
        job = farm.submit(**ENDLESS)
        only = task("--time=2")  # Slurm tells it a minute before, or up to half a minute sooner
        until(lambda: renders(farm, only))
        until(lambda: only not in slurm.jobs())
        assert slurm.end_of(only) == ("COMPLETED", "0:0")
        assert self.troubles(farm, job.id) <= {"handed-back"}
        farm.jobs.cancel(job.id)


@pytest.mark.long_form
class TestTheScaler:
    @pytest.fixture
    def work(self, farm: RealFarm) -> Iterator[str]:
        """A job that goes on until the test ends."""
        job = farm.submit(**ENDLESS)
        until(
            lambda: take_census(farm.redis_client).demand_for().slices
        )  # the monitor has planned some
        yield job.id
        farm.jobs.cancel(job.id)

    def test_finds_its_jobs_again_and_cancels_those_that_wait_first(
        self, farm: RealFarm, slurm: Slurm, scale: Callable[..., Scaler], work: str
    ) -> None:
        # Given five workers of which two find a machine
        first = scale("--max", "5", "--worth", "0.5")
        until(lambda: sorted(slurm.jobs().values()) == ["PENDING"] * 3 + ["RUNNING"] * 2)
        tasks = set(slurm.jobs())
        # If the scaler is killed, and started again
        first.process.kill()
        first.process.wait()
        until(lambda: sum(one.job is not None for one in farm.client.workers()) == 2)
        second = scale("--max", "5", "--worth", "0.5")
        until(lambda: any(report["rendering"] == 2 for report in second.said()))
        # Then it has the same
        assert set(slurm.jobs()) == tasks
        assert not any(report["submit"] for report in second.said())
        # And when less may run, those that wait are cancelled, and those that render stay
        second.end()
        third = scale("--max", "2", "--worth", "0.5")
        until(lambda: list(slurm.jobs().values()) == ["RUNNING"] * 2)
        # Without work these leave as well
        farm.jobs.cancel(work)
        until(lambda: not slurm.jobs())
        third.end()
        assert {one for report in third.said() for one in report["drain"]} <= tasks

    def test_can_take_its_workers_along(
        self, farm: RealFarm, slurm: Slurm, scale: Callable[..., Scaler], work: str
    ) -> None:
        scaler = scale("--max", "3", "--worth", "0.5", "--cancel-on-exit")
        until(lambda: len(slurm.jobs("--states=RUNNING")) == 2)
        until(lambda: any(worker.job is not None for worker in farm.client.workers()))
        scaler.end(signal.SIGINT)
        until(lambda: not slurm.jobs())
        until(lambda: not farm.client.workers())
        assert {entry.what for entry in farm.jobs.log(work)} <= {"handed-back", "committed"}

    def test_waits_for_a_controller_that_is_away(
        self, slurm: Slurm, scale: Callable[..., Scaler], work: str
    ) -> None:
        slurm.stop_controller()
        scaler = scale("--max", "1")
        until(lambda: "squeue failed" in scaler.words())
        slurm.start_controller()
        until(lambda: list(slurm.jobs().values()) == ["RUNNING"])
        scaler.end()

    def test_says_what_slurm_refuses_and_does_not_try_without_end(
        self, slurm: Slurm, scale: Callable[..., Scaler], work: str
    ) -> None:
        scaler = scale("--max", "1", "--partition", "nowhere")
        until(lambda: any(report["held_s"] for report in scaler.said()))
        assert scaler.words().count("invalid partition specified: nowhere") == 1
        scaler.end()
        once = scale("--max", "1", "--partition", "nowhere", "--once")
        assert once.process.wait(60) == 1

    def test_can_look_once_and_only_say_what_it_would_do(
        self, slurm: Slurm, scale: Callable[..., Scaler], work: str
    ) -> None:
        options = ("--max", "1", "--mem", "500M", "--sbatch-option=--nice=5", "--once")
        trial = scale(*options, "--dry-run")
        assert trial.process.wait(60) == 0
        (report,) = trial.said()
        assert (report["submit"], report["array"], slurm.jobs()) == (1, None, {})
        assert {"--cpus-per-task=2", "--mem=500M", "--nice=5"} < set(report["command"])
        # And in earnest, and again while its worker comes
        for submitted in (1, 0):
            scaler = scale(*options)
            assert scaler.process.wait(60) == 0
            assert [one["submit"] for one in scaler.said()] == [submitted]
        (task,) = slurm.jobs()
        assert "Nice=5" in slurm.run("scontrol", "show", "job", task)
