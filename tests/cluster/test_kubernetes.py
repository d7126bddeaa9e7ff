"""The chart in a real cluster: farms are installed, disturbed and replaced, and nothing is lost."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from plateau.client import Client
from plateau.farm.model.states import JobState
from tests.cluster.kubernetes.farm import Release, is_ready
from tests.cluster.kubernetes.node import Node
from tests.cluster.kubernetes.settings import NAME
from tests.cluster.support_chart import ROOT, SCHEMAS, Find
from tests.cluster.support_upgrade import People
from tests.support.farms.faulty_farm import SPEC
from tests.support.farms.real_farm import RealFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.until import until

pytestmark = [pytest.mark.long_form, pytest.mark.timeout(1200)]

#: A job of which all machines make the same bits: the images have an LLVM of their own.
JOB: dict[str, Any] = {**SPEC, "variant": "scalar_rgb"}
#: One that does not end by itself while a test looks on.
LONG: dict[str, Any] = {
    **JOB,
    "parameters": {"width": 128, "height": 128},
    "step": 400,
    "max_spp": 100_000,
    "rule": {"name": "fixed"},
}

#: What pods ask for here, since the node has two cores.
LITTLE = {"cpu": "50m", "memory": "256Mi"}
FITS: dict[str, object] = {
    "api.replicas": 1,
    "api.resources.requests": LITTLE,
    "monitor.replicas": 1,
    "monitor.resources.requests": LITTLE,
    "redis.resources.requests": LITTLE,
}
#: And KEDA's patience, since people wait for this test.
SOON: dict[str, object] = {
    "keda.pollingInterval": 2,
    "keda.cooldownPeriod": 5,
    "keda.scaleDownWindow": 5,
}
PASSWORD, S3_KEY, S3_SECRET = "of-the-tests", "plateau", "secret-of-the-tests"


@pytest.fixture(scope="module")
def node(tool: Find) -> Iterator[Node]:
    before = settings()
    with Node(tool) as node:
        yield node
    # Then nothing of it is left on the machine
    assert settings() == before
    left = [node.folder.parent, Path("/sys/class/net"), *Path("/sys/fs/cgroup").glob("*/")]
    names = {path.name for folder in left for path in folder.iterdir()}
    assert not names & {node.folder.name, "node0", "outside", "pods"}
    assert node.folder.name not in Path("/proc/mounts").read_text()


def settings() -> list[str]:
    """What kubelet would change for the whole machine."""
    names = ("vm/overcommit_memory", "kernel/panic", "kernel/panic_on_oops", "net/ipv4/ip_forward")
    return [Path("/proc/sys", name).read_text() for name in names]


@pytest.fixture(scope="module")
def undisturbed(node: Node, tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """What comes of the job on one machine, without any cluster."""
    folder = tmp_path_factory.mktemp("alone")
    with RealFarm(folder, folder / "cache") as alone:
        alone.start("monitor")
        alone.start("worker")
        return outcome(alone, alone.submit(**JOB).id)


@pytest.fixture(scope="class")
def farm(node: Node, undisturbed: Outcome) -> Iterator[Release]:
    """As `minimal.yaml` has it."""
    farm = Release(node, "minimal")
    farm.install()
    farm.look_inside()
    yield farm
    farm.uninstall()


@pytest.fixture(scope="class")
def equipped(node: Node) -> None:
    """The node has KEDA and, as far as it tells, two GPUs."""
    monitoring = SCHEMAS / "monitoring.coreos.com_servicemonitors.yaml"
    for file in (ROOT / ".cluster-tools" / "keda.yaml", monitoring):
        node.kubectl("apply", "--server-side", f"--filename={file}")
    gpus = json.dumps({"status": {"capacity": {"nvidia.com/gpu": "2"}}})
    node.kubectl("patch", "node", NAME, "--subresource=status", f"--patch={gpus}")
    node.kubectl("label", "node", NAME, "nvidia.com/gpu.present=true")
    for name in ("keda-operator", "keda-metrics-apiserver"):
        node.kubectl("rollout", "status", f"deployment/{name}", "--namespace=keda")


@pytest.mark.parametrize(
    ("where", "told"),
    [
        (("--user",), "run `make test-cluster` as root"),
        (("--mount", "sh", "-c", 'mount -t tmpfs tmpfs /sys/fs/cgroup; exec "$@"', "sh"), "groups"),
    ],
)
def test_a_machine_that_cannot_have_a_node_is_told_why(where: tuple[str, ...], told: str) -> None:
    asked = "from tests.cluster.kubernetes.node import Node; Node(str).__enter__()"
    done = subprocess.run(
        ["unshare", *where, sys.executable, "-c", asked],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert told in done.stderr.splitlines()[-1]


class TestAFarm:
    """Each test leaves it to the next one."""

    def test_renders_what_one_machine_renders_to_the_bit(
        self, farm: Release, undisturbed: Outcome
    ) -> None:
        done = outcome(farm, farm.submit(**JOB).id)
        assert done.job.state is JobState.CONVERGED
        assert_same(done, undisturbed)

    def test_renders_with_the_llvm_of_its_image(self, farm: Release) -> None:
        done = outcome(farm, farm.submit(**SPEC).id)
        assert (done.job.variant, done.job.state) == ("llvm_ad_rgb", JobState.CONVERGED)

    def test_has_started_without_a_warning(self, farm: Release) -> None:
        """But that pods wait for their volumes, and on a busy machine for their secrets."""
        waits = {"FailedMount", "FailedScheduling"}
        assert [said for reason, said in farm.warnings() if reason not in waits] == []

    def test_adds_up_the_same_image_whatever_is_deleted(self, farm: Release) -> None:
        # Given a job that is rendered while one pod after the other is deleted
        job = farm.submit(**LONG)
        for part in ("api", "monitor", "worker-cpu", "redis"):
            merges_more(farm, job.id)
            farm.delete(part)
        merges_more(farm, job.id)
        farm.look_inside()
        # When it is cancelled, and another one rendered as far, to which nothing happens
        farm.client.cancel(job.id)
        disturbed = outcome(farm, job.id)
        twin = outcome(farm, farm.submit(**{**LONG, "max_spp": disturbed.job.spp}).id)
        # Then it is the same to the bit
        assert disturbed.curve == twin.curve[: len(disturbed.curve)] != []
        assert disturbed.image.tobytes() == twin.image.tobytes()

    def test_is_upgraded_under_load_and_nobody_notices(
        self, farm: Release, undisturbed: Outcome
    ) -> None:
        before = {pod["metadata"]["uid"] for pod in farm.pods()}
        with People([farm.url], farm.key, JOB) as people:
            farm.upgrade(**{"settings.PLATEAU_KEEP_RESULTS_DAYS": "30"})
            until(lambda: all(map(is_ready, farm.pods())), every_s=0.5)
        # All but Redis were replaced
        assert len(before & {pod["metadata"]["uid"] for pod in farm.pods()}) == 1
        # And no call has failed for good, and each job came to what it always comes to
        assert people.troubles == []
        assert people.watched != []
        for one in people.watched:
            assert_same(outcome(farm, one.job_id), undisturbed)

    def test_comes_back_with_all_it_had(self, farm: Release, undisturbed: Outcome) -> None:
        known = [job.id for job in farm.client.all_jobs()]
        key, image = farm.key, farm.client.image(known[-1], "image.exr")
        # When the chart is uninstalled, and installed again
        farm.uninstall()
        farm.install()
        farm.look_inside()
        # Then key, jobs and images are there
        with Client(farm.url, key=key) as client:
            assert [job.id for job in client.all_jobs()] == known
            assert client.image(known[-1], "image.exr") == image
        # And a new job comes to the same image
        assert_same(outcome(farm, farm.submit(**JOB).id), undisturbed)


@pytest.mark.usefixtures("equipped")
class TestExamples:
    """Each, but for the size of the machine; KEDA starts its workers and stops them."""

    def test_pools_of_gpus(self, node: Node, undisturbed: Outcome) -> None:
        """Without a GPU: the node says it has two, and Mitsuba finds none."""
        node.kubectl("label", "node", NAME, "node.example.org/kind=spot", "--overwrite")
        gpu = {"cpu": "50m", "memory": "256Mi", "nvidia.com/gpu": 1}
        farm = Release(
            node, "gpu", **FITS, **SOON,
            **{"workers.gpu.min": 1, "workers.gpu.max": 2, "workers.gpu.resources.requests": gpu},
            **{"workers.cpu.max": 2, "workers.cpu.resources": {"requests": LITTLE}},
        )  # fmt: skip
        from_zero_and_back(farm, "worker-cpu", undisturbed)

    def test_everything_that_can_be_switched_on(self, node: Node, undisturbed: Outcome) -> None:
        node.kubectl("label", "node", NAME, "node.example.org/kind=steady", "--overwrite")
        small = {"workers.small.max": 2, "workers.small.resources.requests": LITTLE}
        farm = Release(node, "full", **FITS, **SOON, **small)
        from_zero_and_back(farm, "worker-small", undisturbed)

    def test_a_redis_and_an_s3_of_ones_own(self, node: Node, undisturbed: Outcome) -> None:
        for address in ("10.20.0.7", "10.30.0.10"):
            node.run("ip", "addr", "add", f"{address}/32", "dev", "node0")
        redis = ("--bind", "10.20.0.7", "--port", "6380", "--requirepass", PASSWORD)
        node.start("redis-server", *redis, "--appendonly", "yes", "--save", "")
        (node.folder / "s3" / "renderings").mkdir(parents=True)
        account = ("--access", S3_KEY, "--secret", S3_SECRET, "--region", "eu-central-1")
        node.start("versitygw", *account, "--port", "10.30.0.10:443", "posix", "s3")
        farm = Release(
            node, "external", **FITS, **SOON,
            **{"blobs.s3.endpoint": "http://10.30.0.10:443", "blobs.s3.allowHttp": True},
            **{"workerDefaults.max": 2, "workerDefaults.resources.requests": LITTLE},
        )  # fmt: skip
        url = f"redis://:{PASSWORD}@10.20.0.7:6380/0"
        farm.make_secret("farm-redis", {f"{user}-url": url for user in USERS})
        farm.make_secret("farm-keys", {"admin": key("a"), "viewer": key("b")})
        farm.make_secret("farm-notify", {"targets": "ops json://10.20.0.7/\n"})
        for name in ("farm-s3", "farm-s3-workers"):
            s3 = {"AWS_ACCESS_KEY_ID": S3_KEY, "AWS_SECRET_ACCESS_KEY": S3_SECRET}
            farm.make_secret(name, s3)
        from_zero_and_back(farm, "worker-cpu", undisturbed)


USERS = ("admin", "api", "monitor", "worker")


def key(digit: str) -> str:
    """An API key."""
    return f"plateau_{digit * 12}_{digit * 64}"


def merges_more(farm: Release, job_id: str) -> None:
    """Wait until a slice of the job has been rendered and merged from now on."""
    before = farm.client.job(job_id).spp
    until(lambda: farm.client.job(job_id).spp > before, 300)


def from_zero_and_back(farm: Release, pool: str, undisturbed: Outcome) -> None:
    """A pool has no worker, gets some for a job, which has the usual bits, and has none again."""
    farm.install()
    until(lambda: not farm.pods(pool), every_s=0.5)
    job = farm.submit(**JOB)
    until(lambda: farm.pods(pool), every_s=0.5)
    until(lambda: farm.client.job(job.id).ended_at is not None, 300)
    done = farm.client.job(job.id)
    assert (done.state, done.spp) == (undisturbed.job.state, undisturbed.job.spp)
    assert farm.curve(done) == undisturbed.curve
    assert farm.image(done).tobytes() == undisturbed.image.tobytes()
    until(lambda: not farm.pods(pool), every_s=0.5)
    farm.uninstall()
