"""When a queued job is expected to start."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.farms.real_farm import RealFarm
from tests.support.until import until

SHORT = {
    "parameters": {"width": 48, "height": 48},
    "variant": "scalar_rgb",
    "step": 200,
    "slice_spp": 50,
    "max_spp": 200,
    "rule": {"name": "fixed", "spp": 200},
}
#: Of 2,000 slices, so that it renders for as long as the test looks at it.
LONG = {**SHORT, "max_spp": 100_000, "rule": {"name": "fixed", "spp": 100_000}}


@pytest.fixture
def farm(tmp_path: Path, cache: Path) -> Iterator[RealFarm]:
    """A farm to itself: workers that others killed a moment ago would count as free ones."""
    with RealFarm(tmp_path, cache) as farm:
        yield farm


@pytest.mark.long
def test_queued_jobs_start_in_their_order_by_turns_with_a_long_one(farm: RealFarm) -> None:
    farm.start("monitor")
    farm.workers(1)
    until(farm.client.workers)
    first = farm.submit(**LONG)
    second, third = (farm.submit(**SHORT) for _ in range(2))
    # Given slices that tell how long a slice takes
    until(lambda: farm.client.job(first.id).committed_spp >= 100)
    # When it is asked for the others, whose turns come before the long one ends
    waits = [farm.client.job(job.id) for job in (second, third)]
    for job in waits:
        assert job.state == "queued"
        assert (job.expected_start_is_bound, job.expected_start_unknown) == (False, None)
        assert job.expected_start_s is not None
        assert 0 < job.expected_start_s < 60
    # Then so they start, with nothing more to expect
    ended = farm.client.wait(second.id)
    assert ended.expected_start_s is None
    assert farm.client.job(first.id).state == "rendering"
    left = farm.client.job(third.id)
    assert left.state == "queued"
    assert left.expected_start_s is not None
