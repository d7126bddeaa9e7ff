"""Acceptance tests run the farm as a user does; they share what Mitsuba has compiled."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.real_farm import RealFarm


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache) as farm:
        yield farm
