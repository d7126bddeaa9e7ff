"""The real renderer, in each variant that this machine can test, and a worker with its jobs."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import redis

from plateau.farm.blobs.store import Blobs
from tests.support.farms.bench import Bench
from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.support.variants import VARIANTS, library_for


@pytest.fixture(scope="module", params=VARIANTS)
def mitsuba(request: pytest.FixtureRequest) -> Iterator[MitsubaProcess]:
    variant: str = request.param
    with MitsubaProcess(variant, library_for(variant)) as process:
        yield process


@pytest.fixture(scope="module")
def scalar() -> Iterator[MitsubaProcess]:
    with MitsubaProcess("scalar_rgb") as process:
        yield process


@pytest.fixture
def bench(client: redis.Redis, redis_url: str, store: Blobs, tmp_path: Path) -> Bench:
    return Bench(client, redis_url, store, tmp_path)
