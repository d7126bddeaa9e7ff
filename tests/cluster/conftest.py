"""More than one machine: real Slurm, S3 servers, networks and charts, by `make test-cluster`."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import pytest

from tests.cluster import support_chart

TOOLS = Path(__file__).parents[2] / ".cluster-tools" / "bin"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave what is marked `long_form` out of the short form."""
    if os.environ.get("CLUSTER_TESTS") == "short":
        left_out = [item for item in items if item.get_closest_marker("long_form")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


@pytest.fixture(params=support_chart.EXAMPLES)
def found(request: pytest.FixtureRequest) -> list[support_chart.Manifest]:
    """The objects of an example of the chart."""
    return support_chart.rendered(request.param)


@pytest.fixture(scope="session")
def form() -> Literal["short", "long"]:
    """How much the tests do: CI runs the short form, `make test-cluster` the long one."""
    return "short" if os.environ.get("CLUSTER_TESTS") == "short" else "long"


@pytest.fixture(scope="session")
def tool() -> Callable[[str], Path]:
    """Gives where a program lies that tests/cluster/install.sh has installed or built."""

    def find(name: str) -> Path:
        found = shutil.which(name, path=f"{TOOLS}{os.pathsep}{os.environ['PATH']}:/usr/sbin:/sbin")
        assert found, f"{name} is missing: run `make test-cluster`, which installs it"
        return Path(found)

    return find
