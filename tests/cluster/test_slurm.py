"""Workers by Slurm: a command that brings them for its run, and tasks by hand for a service.

Real Slurm, two nodes, real signals. The command's own machine is not one of the nodes.
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from bench import engines
from tests.cluster.support_engines import (
    ENDLESS_JOB,
    JOB,
    UNFIT,
    Result,
    Run,
    alone,
    are_back_before_the_results,
    commands,
    is_refused,
    stopping,
)
from tests.cluster.support_slurm import NODES, Slurm
from tests.support.farms.real_farm import RealFarm
from tests.support.processes.commands import Command
from tests.support.until import until

#: On a busy machine all of it takes many times as long.
pytestmark = pytest.mark.timeout(900)

SCRIPT = Path(__file__).parents[2] / "deploy" / "slurm" / "worker.sbatch"

#: A program that takes the first image, and the others when it may.
MAP = """
import os, time, plateau
values = [{"width": 48, "height": 48, "intensity": 5 + step} for step in range(5)]
asked = {"target": "fixed:spp=64", "variant": "scalar_rgb"}
images = plateau.map("scenes:box", values, workers=2, on="slurm", **asked)
found = [next(images).index]
print("the first of 5", flush=True)
while not os.path.exists(os.environ["GO_ON"]):
    time.sleep(0.02)
print(sorted([*found, *(one.index for one in images if one.image.any())]))
"""


@pytest.fixture(scope="module")
def cluster(
    tmp_path_factory: pytest.TempPathFactory, tool: Callable[[str], Path]
) -> Iterator[Slurm]:
    with Slurm(tmp_path_factory.mktemp("s"), tool) as cluster:
        yield cluster


@pytest.fixture
def slurm(cluster: Slurm) -> Iterator[Slurm]:
    """It is empty after each test."""
    yield cluster
    cluster.empty()


@pytest.fixture(scope="module")
def by_itself(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return alone(tmp_path_factory.mktemp("alone"))


class TestOneCommand:
    """`plateau render --on slurm`."""

    @pytest.fixture
    def run(self, slurm: Slurm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Run]:
        monkeypatch.chdir(tmp_path)  # where the logs of the tasks are
        with commands(tmp_path, "slurm", **slurm.environment) as run:
            yield run

    def test_brings_workers_outlives_a_node_and_gives_all_back(
        self, run: Run, slurm: Slurm, tmp_path: Path, by_itself: Result
    ) -> None:
        command = run("--workers", "2", "--threads", "2", **stopping(tmp_path))
        # A worker comes to each node, and says so
        until(lambda: len(slurm.jobs("--states=RUNNING")) == 2, complaint=lambda: command.said)
        assert {*slurm.run("squeue", "--noheader", "--array", "-o", "%N").split()} == set(NODES)
        command.wait_for(r"\b200 spp")
        # If a node dies in the middle of its slices
        slurm.kill_node("n1")
        # Then the other one does the rest, and Slurm has its nodes back before there are results
        found = are_back_before_the_results(command, tmp_path / "out", lambda: not slurm.jobs())
        # The image and the curve are those of one worker, and nothing is left here
        assert found == by_itself
        command.is_gone()
        assert [path.name for path in tmp_path.iterdir() if path.suffix == ".log"] == []
        slurm.start_node("n1")
        until(lambda: slurm.states() == dict.fromkeys(NODES, "idle"), every_s=0.1)

    @pytest.mark.parametrize("node", UNFIT)
    def test_a_node_that_cannot_work_ends_it_at_once(
        self, node: str, run: Run, slurm: Slurm, tmp_path: Path
    ) -> None:
        is_refused(run, node, tmp_path)
        until(lambda: not slurm.jobs())

    def test_a_map_gives_its_nodes_back_while_its_caller_is_busy_with_the_first_image(
        self, slurm: Slurm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)  # for Slurm's logs
        told = slurm.environment | {"GO_ON": str(tmp_path / "go on")}
        command = Command(folder=tmp_path, program=("-c", MAP), **told)
        command.wait_for("the first of 5")
        until(lambda: not slurm.jobs(), complaint=lambda: command.said)
        (tmp_path / "go on").touch()
        assert command.exit_code() == 0
        assert "[0, 1, 2, 3, 4]" in command.said
        command.is_gone()

    def test_says_what_it_waits_for_and_gives_the_place_in_the_queue_back(
        self, run: Run, slurm: Slurm
    ) -> None:
        slurm.run("sbatch", "--exclusive", "--nodes=2", "--output=/dev/null", "--wrap=sleep 600")
        until(lambda: list(slurm.jobs().values()) == ["RUNNING"])
        command = run("--workers", "2", dataset=True)
        command.wait_for(r"nodes: 0 of 2 workers run; 2 wait \((Resources|Priority)")
        command.process.send_signal(signal.SIGINT)
        assert command.exit_code() == 130
        until(lambda: list(slurm.jobs().values()) == ["RUNNING"])
        command.is_gone()

    @pytest.mark.parametrize(
        "how", ["is killed", pytest.param("loses its machine", marks=pytest.mark.long_form)]
    )
    def test_when_the_front_dies_the_nodes_end_their_work(
        self, how: str, run: Run, slurm: Slurm
    ) -> None:
        command = run("--workers", "2", job=ENDLESS_JOB)
        command.wait_for(r"\b200 spp")
        # Two supervisors, and their render children
        workers = until(lambda: found if len(found := slurm.processes()) >= 4 else None)
        if how == "is killed":
            command.process.kill()
        else:  # nobody is left who could tell Slurm
            for one in [psutil.Process(command.process.pid), *command.family()]:
                with suppress(psutil.NoSuchProcess):  # a child goes with its parent
                    one.kill()
        # Who is killed has somebody who tells Slurm; else it takes half a minute of silence
        until(lambda: not slurm.jobs(), 240)
        psutil.wait_procs(workers, timeout=60)
        assert not any(one.is_running() for one in workers)
        command.is_gone()

    @pytest.mark.long_form
    def test_replaces_who_leaves_and_not_who_was_cancelled(self, run: Run, slurm: Slurm) -> None:
        command = run("--workers", "2", job=ENDLESS_JOB)
        command.wait_for(r"\b200 spp")
        first, second = slurm.jobs()
        # A controller that is away for a while is waited for
        slurm.stop_controller()
        command.wait_for("Slurm's squeue failed: .*; trying again")
        slurm.start_controller()
        # Whoever is pushed aside begins again
        urgent = ("--partition=urgent", "--exclusive", "--nodes=2", "--wrap=sleep 3")
        slurm.run("sbatch", *urgent, "--output=/dev/null")
        until(lambda: {first, second} <= set(slurm.jobs("--states=PENDING")))
        until(lambda: {first, second} == set(slurm.jobs("--states=RUNNING")))
        until(lambda: len(slurm.processes()) >= 6)  # for each a keeper, a supervisor and a child
        # As before a time limit
        slurm.run("scancel", "--batch", "--signal=TERM", first)
        until(lambda: first not in slurm.jobs() and len(slurm.jobs("--states=RUNNING")) == 2)
        # Somebody wants no more of it
        slurm.run("scancel", second)
        until(lambda: second not in slurm.jobs())
        (third,) = slurm.jobs()
        slurm.run("scancel", third)
        assert command.exit_code() == 1
        assert "somebody cancelled all workers of this run" in command.said
        assert slurm.jobs() == {}

    @pytest.mark.long_form
    def test_says_what_no_node_that_came_can_do(self, run: Run) -> None:
        job = tuple("cuda_ad_rgb" if one == "scalar_rgb" else one for one in JOB)
        command = run("--workers", "1", job=job)
        command.wait_for(r"job box waits for .*cuda_ad_rgb")
        command.process.send_signal(signal.SIGINT)
        assert command.exit_code() == 130

    @pytest.mark.long_form
    def test_quotes_what_slurm_refuses(self, run: Run, slurm: Slurm) -> None:
        command = run("--on", "slurm --partition=nowhere", dataset=True)
        assert command.exit_code() == 1
        assert "Slurm's sbatch failed: invalid partition specified: nowhere; Batch" in command.said
        command.is_gone()

    @pytest.mark.long_form
    def test_it_is_measured_what_a_farm_costs_that_comes_and_goes(
        self, cluster: Slurm, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name, value in cluster.environment.items():
            monkeypatch.setenv(name, value)
        plan = engines.Plan(engines=("slurm",), workers=(2,), size=48, spp=400)
        found = engines.measure(plan)  # of the same image, here and there
        there = found["slurm, 2 workers"]
        assert there.total_s > there.first_s > 0
        assert 0 < float(there.share.rstrip("%")) <= 100


@pytest.mark.long_form
def test_a_worker_may_be_submitted_by_hand_for_a_service(
    tmp_path: Path, cache: Path, slurm: Slurm
) -> None:
    endless = {"variant": "scalar_rgb", "max_spp": 500_000, "rule": "fixed:spp=500000"}
    with RealFarm(tmp_path, cache, plain=True, **slurm.environment) as farm:
        farm.start("monitor")
        job = farm.submit(parameters={"width": 48, "height": 48}, slice_spp=50, **endless)
        told = {**farm.environment, "PLATEAU_PYTHON": sys.executable, "PLATEAU_THREADS": ""}
        options = ("--array=1-1", "--cpus-per-task=1", "--mem=600M", "--time=2")
        log = f"--output={tmp_path}/plateau-%A_%a.log"
        task = slurm.run("sbatch", "--parsable", *options, log, str(SCRIPT), **told) + "_1"
        (worker,) = until(farm.client.workers)
        assert (worker.threads, worker.label) == (1, f"slurm:{task}")
        until(lambda: farm.jobs.get(job.id).committed_spp)
        # Slurm tells it to leave a minute before its time is over, or up to half a minute sooner
        until(lambda: not slurm.jobs(), 240)
        assert slurm.end_of(task) == ("COMPLETED", "0:0")
        assert {one.what for one in farm.jobs.log(job.id)} <= {"committed", "handed-back"}
