"""By zones, samples decide where others go, and yet the mean of no zone is off.

Real jobs of one scene with many seeds are compared with as many of whole frames. An unbiased farm
would be found biased once in a thousand times, over all zones of all scenes.
``LONG_TESTS=1`` takes all scenes, with 64 jobs each: half an hour.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.statistical.zone_means import Difference, compared, subjects
from tests.support import long_tests
from tests.support.farms.real_farm import RealFarm

SHORT = [("CAUSTIC", 5)]
CASES = [(name, 64) for name in subjects()] if long_tests.WANTED else SHORT


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("name", "jobs"), CASES)
@pytest.mark.long
def test_jobs_by_zones_have_the_mean_of_whole_frames(
    tmp_path: Path, cache: Path, name: str, jobs: int
) -> None:
    with RealFarm(tmp_path, cache) as farm:
        farm.start("monitor")
        farm.workers(2)
        greatest, spread = compared(farm.client, subjects()[name], jobs)
    assert spread > 1.25  # 1.5 in BOX 2, and more in the others
    assert greatest < 1


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
