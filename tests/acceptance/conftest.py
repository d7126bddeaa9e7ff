"""Acceptance tests run the farm as a user does; they share its Redis, its API and its blobs."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.farms.real_farm import RealFarm
from tests.support.until import until
from tests.worker.conftest import scalar as scalar


@pytest.fixture(scope="session")
def shared_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        yield farm


@pytest.fixture
def farm(shared_farm: RealFarm) -> Iterator[RealFarm]:
    """The shared farm, with nothing but its API running before and after."""
    shared_farm.stop_all()
    yield shared_farm
    shared_farm.stop_all()


@pytest.fixture
def staffed(shared_farm: RealFarm) -> RealFarm:
    """The shared farm with a monitor and a worker, which serve test after test."""
    if not shared_farm.staff or shared_farm.processes[1:] != shared_farm.staff:
        shared_farm.stop_all()
        shared_farm.staff = [shared_farm.start("monitor"), *shared_farm.workers(1)]
        until(shared_farm.client.workers)
    return shared_farm
