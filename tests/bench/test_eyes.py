"""What the benchmark of the two eyes says of noise whose truth is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bench import eyes

SPP = 25


@pytest.fixture(scope="module")
def recording() -> NDArray[np.float32]:
    """100 slices of a grey film."""
    noise = np.random.default_rng(1).normal(0, 0.05, (100, 48, 48, 3))
    return np.float32(0.4) + noise.astype(np.float32)


@pytest.fixture(scope="module")
def found(recording) -> dict[str, float]:
    return {one.name: one.value for one in eyes.measured(recording, SPP, runs=2)}


def test_more_quality_takes_more_samples(found):
    for view in eyes.VIEWS:
        least, more = (found[f"{view}: spp for {target:g} JOD"] for target in eyes.TARGETS)
        assert 0 < least < more


def test_the_estimate_is_right_on_grey(found):
    ratios = [value for name, value in found.items() if "estimated / true" in name]
    assert len(ratios) == 3 * len(eyes.VIEWS)  # at 100, 200 and 400 spp
    assert all(0.85 < ratio < 1.2 for ratio in ratios)
