"""What the benchmark of the two eyes says of noise whose truth is known."""

import numpy as np
import pytest

from bench import eyes

SPP = 25


@pytest.fixture(scope="module")
def found() -> dict[str, list[list[str]]]:
    """Of 100 slices of a grey film."""
    noise = np.random.default_rng(1).normal(0, 0.05, (100, 48, 48, 3))
    return eyes.tables("grey", np.float32(0.4) + noise.astype(np.float32), SPP, runs=2)


def test_more_quality_takes_more_samples(found: dict[str, list[list[str]]]) -> None:
    row = found["eyes"][1]
    for cell in row[-len(eyes.VIEWS) :]:
        least, more = (float(number.replace(",", "")) for number in cell.split(", "))
        assert 0 < least < more


def test_the_estimate_is_right_on_grey(found: dict[str, list[list[str]]]) -> None:
    _, *rows = found["eyes-estimate"]
    assert [view for _, view, *_ in rows] == list(eyes.VIEWS)
    for _, _, ratios, _ in rows:
        assert all(0.85 < float(ratio) < 1.2 for ratio in ratios.split(" to "))
