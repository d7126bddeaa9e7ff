"""By zones, samples decide where others go, and yet the mean of no zone is off.

Real jobs of one scene with many seeds are compared with as many of whole frames. An unbiased farm
would be found biased once in a thousand times, over all zones of all scenes (`bench.bias`).
``LONG_TESTS=1`` takes all scenes, with 64 jobs each: half an hour.
"""

from pathlib import Path

import numpy as np
import pytest

from bench.bias import Difference, compared, subjects
from bench.support.farms.service_farm import ServiceFarm
from plateau.client import Client
from tests.support import long_tests

SHORT = [("CAUSTIC", 5)]
CASES = [(name, 64) for name in subjects()] if long_tests.WANTED else SHORT


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("name", "jobs"), CASES)
@pytest.mark.long
def test_jobs_by_zones_have_the_mean_of_whole_frames(tmp_path: Path, name: str, jobs: int) -> None:
    with ServiceFarm(tmp_path, jobs=0, threads=1, workers=2) as farm, Client(farm.url) as client:
        found = compared(client, subjects()[name], jobs, jobs)
    assert found["most spp over least"] > 1.25  # 1.5 in BOX 2, and more in the others
    assert found["greatest deviation"] < 1, found


def test_who_stops_by_his_own_luck_is_found() -> None:
    # Given renders of 16 zones of one pixel, each with rare bright samples
    rng = np.random.default_rng(1)

    def render(spp: int) -> np.ndarray:
        return 1 + 10 * (rng.random((spp, 16)) < 0.02).mean(axis=0)

    fair, fixed = (np.stack([render(800) for _ in range(64)]) for _ in range(2))
    first, second = (np.stack([render(400) for _ in range(64)]) for _ in range(2))
    # When those that are dark after half their samples end there
    stopped = np.where(first < 1.2, first, (first + second) / 2)
    # Then their means are off, and those of the others are not
    assert Difference.of(fair, fixed).greatest(16) < 1
    assert Difference.of(stopped, fixed).greatest(16) > 1
