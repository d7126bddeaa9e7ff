"""A farm of real processes, which all tests share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.farms.real_farm import RealFarm


@pytest.fixture(scope="session")
def farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        farm.start("monitor")
        farm.workers(2)
        yield farm
