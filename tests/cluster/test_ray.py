"""`plateau render --on ray`, on a real Ray whose nodes come and go: Ray's own cluster utility."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from tests.cluster.conftest import TOOLS
from tests.cluster.support_engines import (
    ENDLESS_JOB,
    UNFIT,
    Run,
    alone,
    are_back_before_the_results,
    commands,
    is_refused,
    stopping,
)
from tests.support.until import until

pytestmark = pytest.mark.timeout(900)

PYTHON = TOOLS.parent / "ray" / "bin" / "python"

#: A head without processors, and nodes with one each, as standard input asks for.
CLUSTER = """
import os, sys, ray
from ray.cluster_utils import Cluster
answers = os.fdopen(os.dup(1), "w", buffering=1)
os.dup2(2, 1)  # for what Ray says
head = {"num_cpus": 0, "include_dashboard": False}
cluster, nodes = Cluster(initialize_head=True, head_node_args=head), []
ray.init(cluster.address)
for line in sys.stdin:
    if line == "add\\n":
        nodes.append(cluster.add_node(num_cpus=1))
    elif line == "die\\n":
        cluster.remove_node(nodes.pop(), allow_graceful=False)
    print(len(nodes), ray.available_resources().get("CPU", 0), cluster.address, file=answers)
cluster.shutdown()
"""


class RayCluster:
    """A Ray without a node at first, until standard input ends."""

    def __init__(self, folder: str) -> None:
        assert PYTHON.exists(), "Ray is missing: run `make test-cluster`, which installs it"
        self._said = Path(folder, "ray-cluster.log")
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                [PYTHON, "-c", CLUSTER],
                env=os.environ | {"RAY_TMPDIR": folder},  # else it needs a /tmp/ray that is there
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said,
                text=True,
            )
        self._nodes = 0

    def have(self, nodes: int) -> None:
        """Add nodes, or have the newest die."""
        while self._nodes != nodes:
            self._nodes = int(self._answer("add" if self._nodes < nodes else "die")[0])

    def free(self) -> float:
        """The processors that nobody uses."""
        return float(self._answer("look")[1])

    @property
    def address(self) -> str:
        return self._answer("look")[2]

    def _answer(self, asked: str) -> list[str]:
        assert self.process.stdout is not None
        print(asked, file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline().split()
        assert answer, f"Ray's cluster ended: {self._said.read_text()}"
        return answer


@pytest.fixture(scope="module")
def cluster() -> Iterator[RayCluster]:
    cluster = RayCluster(os.environ["TESTS_TEMPORARY"])  # a short path: sockets lie in it
    yield cluster
    cluster.process.communicate(timeout=60)


@pytest.fixture
def run(cluster: RayCluster, tmp_path: Path) -> Iterator[Run]:
    with commands(tmp_path, f"ray --address={cluster.address}", str(PYTHON)) as run:
        yield run


def nodes() -> list[psutil.Process]:
    """The processes of the workers, and their render children."""
    found = []
    for one in psutil.process_iter():
        with suppress(psutil.Error):
            is_node = "plateau.engines.node" in " ".join(one.cmdline())
            if is_node and "PLATEAU_FRONT" in one.environ():
                found += [one, *one.children(recursive=True)]
    return found


def test_one_command_uses_what_comes_outlives_what_goes_and_gives_all_back(
    run: Run, cluster: RayCluster, tmp_path: Path
) -> None:
    command = run("--workers", "3", **stopping(tmp_path))
    command.wait_for(r"nodes: 0 of 3 workers run; 3 wait \(for 1 CPU; no node has as much\)")
    # Nodes that come are used
    cluster.have(2)
    command.wait_for(r"nodes: 2 of 3 workers run; 1 waits \(for 1 CPU\)")
    command.wait_for(r"\b200 spp")
    # One that dies takes the slices in its hands with it, and nothing else
    cluster.have(1)
    # Then its nodes are free before there are results, which are those of one worker on one machine
    found = are_back_before_the_results(
        command, tmp_path / "out", lambda: not nodes() and cluster.free() == 1
    )
    assert found == alone(tmp_path / "alone")
    command.is_gone()


def test_a_data_set_is_made_and_its_nodes_are_given_back(
    run: Run, cluster: RayCluster, tmp_path: Path
) -> None:
    cluster.have(2)
    command = run("--workers", "2", dataset=True)
    assert command.exit_code() == 0, command.said
    lines = (tmp_path / "out" / "manifest.jsonl").read_text().splitlines()
    assert [json.loads(line)["spp"] for line in lines] == [64] * 6
    command.is_gone()
    until(lambda: not nodes() and cluster.free() == 2)


@pytest.mark.parametrize("node", UNFIT)
def test_a_node_that_cannot_work_ends_it_at_once(
    node: str, run: Run, cluster: RayCluster, tmp_path: Path
) -> None:
    cluster.have(2)
    is_refused(run, node, tmp_path)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_when_the_front_goes_the_nodes_end_their_work(
    how: signal.Signals, run: Run, cluster: RayCluster
) -> None:
    cluster.have(2)
    command = run("--workers", "2", "--threads", "1", job=ENDLESS_JOB)
    command.wait_for(r"\b200 spp")
    # Two supervisors, and their render children
    workers = until(lambda: found if len(found := nodes()) >= 4 else None)
    command.process.send_signal(how)
    assert command.exit_code() == (130 if how is signal.SIGINT else -how)
    _, alive = psutil.wait_procs(workers, timeout=60)
    assert not alive
    command.is_gone()


def test_where_there_is_no_ray_it_says_what_to_do(run: Run) -> None:
    command = run("--on", "ray --address=ray://127.0.0.1:9 --num-gpus=1")
    assert command.exit_code() == 1
    assert "no Ray cluster answers at 'ray://127.0.0.1:9' ([Errno 111]" in command.said
    refused = run("--on", "ray --gpus=1")
    assert refused.exit_code() == 1
    assert "--on ray: unrecognized arguments: --gpus=1; it takes ray [--address" in refused.said
