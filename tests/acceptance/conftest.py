"""Acceptance tests run the farm as a user does; they share its Redis, its API and its blobs."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.farms.real_farm import RealFarm


@pytest.fixture(scope="session")
def shared_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        yield farm


@pytest.fixture
def farm(shared_farm: RealFarm) -> Iterator[RealFarm]:
    """The shared farm, with nothing but its API running before and after."""
    yield shared_farm
    shared_farm.stop_all()
