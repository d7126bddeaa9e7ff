"""What the chart's pods run works, as the users that they are and with what they are told."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import httpx
import pytest

from plateau.client import Client
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.metric.compiled.jit import cache_folder
from tests.cluster import support_chart as chart
from tests.cluster.support_chart import ROOT, Find, Manifest
from tests.cluster.support_pods import Node, needs_root
from tests.support.until import until

NAME = "farm-plateau"
BOX = ROOT / "scenes" / "box"


@pytest.fixture
def found() -> list[Manifest]:
    return chart.rendered("gpu")


@pytest.fixture
def node(found: list[Manifest], tool: Find) -> Iterator[Node]:
    needs_root()
    # pytest's own folder is root's alone.
    with TemporaryDirectory(prefix="plateau-node-") as folder:
        Path(folder).chmod(0o755)
        with Node(Path(folder), found, tool) as node:
            yield node


def wanted(node: Node, found: list[Manifest], pool: str) -> float:
    """What KEDA reads for a pool: by the pool's trigger and the key that it is given."""
    [trigger] = chart.named(found, "ScaledObject", f"{NAME}-worker-{pool}")["spec"]["triggers"]
    name = trigger["authenticationRef"]["name"]
    [given] = chart.named(found, "TriggerAuthentication", name)["spec"]["secretTargetRef"]
    assert (given["parameter"], trigger["metadata"]["authMode"]) == ("token", "bearer")
    url = node.running[f"{NAME}-api"].here(trigger["metadata"]["url"])
    token = node.secrets[given["name"]][given["key"]]
    answer = httpx.get(url, headers={"Authorization": f"Bearer {token}"}, trust_env=False)
    assert answer.status_code == 200, answer.text
    return float(answer.json()[trigger["metadata"]["valueLocation"]])


def a_job_from_zero(node: Node, found: list[Manifest]) -> None:
    """A farm starts, scales from zero and back, and ends in time."""
    # Given all but workers
    for part in ("redis", "api", "monitor"):
        node.start(f"{NAME}-{part}")
    assert wanted(node, found, "cpu") == wanted(node, found, "gpu") == 0
    # When a job comes
    api = f"http://{node.addresses[f'{NAME}-api']}"
    with Client(api, key=node.secrets[f"{NAME}-keys"]["admin"]) as client:
        spec = {"parameters": {"width": 32, "height": 32}, "variant": "scalar_rgb", "step": 20}
        rule = {"rule": {"name": "fixed", "spp": 40}, "slice_spp": 10, "max_spp": 40}
        job = client.submit(BOX, JobSpec.model_validate({**spec, **rule}))
        # Then the pools that can render it are wanted, and nothing else has to run for that
        until(lambda: wanted(node, found, "cpu") >= 1)
        assert wanted(node, found, "gpu") == wanted(node, found, "cpu")
        node.start(f"{NAME}-worker-cpu")
        # It says whose worker it is, and renders with as many threads as its pod has cores
        [worker] = client.workers()
        assert worker.threads == 4
        until(lambda: client.job(job.id).state is JobState.CONVERGED)
        until(lambda: wanted(node, found, "cpu") == 0)
    # And the worker can go, and all others
    for part in ("worker-cpu", "monitor", "api", "redis"):
        node.running[f"{NAME}-{part}"].end()


def test_a_farm_scales_from_zero_and_back(node: Node, found: list[Manifest], form: str) -> None:
    if form == "short":
        give_compiled_kernels(node)
    a_job_from_zero(node, found)


def give_compiled_kernels(node: Node) -> None:
    """Spare the monitor the compiler, which takes some 10 s of a quiet core."""
    compiled, cache = cache_folder(), node.folder / f"{NAME}-monitor" / "cache"
    assert compiled is not None
    shutil.copytree(compiled, cache / "kernels" / compiled.name)
    for path in (cache / "kernels").rglob("*"):
        os.chown(path, 10001, 10001)
    os.chown(cache / "kernels", 10001, 10001)
