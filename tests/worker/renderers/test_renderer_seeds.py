"""What `plateau.farm.model.seeds` says of Mitsuba's random numbers is what Mitsuba does.

In the noise scene all pixels are alike, so a pixel's value tells which random numbers it was
rendered from: equal values in different pixels mean reused random numbers.
"""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.model.seeds import SeedSchedule

NOISE = Path(__file__).parents[2] / "reference/scenes/noise"

#: Sides that are no multiples of the 32-pixel block, and a film smaller than one.
ODD_SIZES = [(40, 24), (33, 65), (7, 5)]


def _values(film: np.ndarray) -> set[tuple[float, ...]]:
    """The values of a film's pixels."""
    # Rounded: the same random numbers in another pixel may differ in the last bits.
    return set(map(tuple, film[..., :3].reshape(-1, 3).astype(np.float64).round(5).tolist()))


def _shared(a: np.ndarray, b: np.ndarray) -> float:
    """The share of pixel values that two films have in common."""
    return len(_values(a) & _values(b)) / len(_values(a))


def test_scalar_seeds_wrap_at_32_bits(scalar):
    # The trap: at 64×64 the seeds 1 and 1 + 2**20 are one.
    scalar.load(NOISE, width=64, height=64)
    assert np.array_equal(scalar.render_pass(1, 1), scalar.render_pass(1, 1 + 2**20))
    assert _shared(scalar.render_pass(1, 1), scalar.render_pass(1, 2)) == 0


@pytest.mark.parametrize("size", ODD_SIZES)
def test_neighbouring_scalar_seeds_share_random_numbers_at_odd_sizes(scalar, size):
    scalar.load(NOISE, width=size[0], height=size[1])
    assert _shared(scalar.render_pass(1, 0), scalar.render_pass(1, 1)) > 0.02


@pytest.mark.parametrize("size", [*ODD_SIZES, (64, 64)])
def test_passes_of_a_schedule_share_none(mitsuba, size):
    mitsuba.load(NOISE, width=size[0], height=size[1])
    slice_spp = 3 if mitsuba.variant == "scalar_rgb" else 128  # two passes either way
    schedule = SeedSchedule(mitsuba.variant, *size, slice_spp, 4 * slice_spp)
    films = [
        # All of 1 spp: sums of more could not be told apart.
        _values(mitsuba.render_pass(1, one.seed))
        for index in range(schedule.slices)
        for one in schedule.passes(index)
    ]
    assert len(films) == 8
    assert all(a.isdisjoint(b) for a, b in combinations(films, 2))
