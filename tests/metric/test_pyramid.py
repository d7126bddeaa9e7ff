import numpy as np
import pytest

from plateau.metric.pyramid import blurred_levels, border_index

WEIGHTS = {-2: 0.05, -1: 0.25, 0: 0.4, 1: 0.25, 2: 0.05}


def read_with_borders(line, n):
    """The border rule as it is printed, applied until it lands on the line."""
    size = len(line)
    while n < 0 or n >= size:
        if n < 0:
            n = -n
        if n >= size:
            n = 2 * size - n - 1
    return line[n]


def blur_by_the_formula(plane):
    """Twenty-five reads for each pixel, in float64."""
    height, width = plane.shape
    blurred = np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            for dy, wy in WEIGHTS.items():
                row = read_with_borders(plane, y + dy)
                for dx, wx in WEIGHTS.items():
                    blurred[y, x] += wy * wx * read_with_borders(row, x + dx)
    return blurred


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 2), (2, 1), (2, 2), (1, 7), (7, 1), (3, 2), (4, 5), (9, 16)]
)
def test_every_level_is_the_formula_applied_to_the_one_before(shape):
    plane = np.random.default_rng(7).uniform(0, 100, shape).astype(np.float32)

    levels = blurred_levels(plane)

    assert levels.shape == (8, *shape)
    assert levels.dtype == np.float32
    assert np.array_equal(levels[0], plane)
    expected = plane
    for level in levels[1:]:
        expected = blur_by_the_formula(expected)
        np.testing.assert_allclose(level, expected, rtol=3e-6)


def test_the_two_ends_of_a_line_differ():
    # Before the line the edge is not repeated, behind it it is.
    assert [border_index(n, 4) for n in range(-2, 6)] == [2, 1, 0, 1, 2, 3, 3, 2]


@pytest.mark.parametrize("size", [1, 2, 3, 4, 100])
def test_every_index_lands_on_the_line(size):
    assert all(0 <= border_index(n, size) < size for n in range(-2, size + 2))


def test_a_line_without_pixels_is_refused():
    with pytest.raises(ValueError, match="at least one pixel"):
        border_index(0, 0)


def test_an_impulse_spreads_by_one_blur_for_each_level():
    plane = np.zeros((33, 33), np.float32)
    plane[16, 16] = 1
    for i, level in enumerate(blurred_levels(plane)):
        variance = (level.sum(axis=0) * (np.arange(33) - 16.0) ** 2).sum()
        # Each blur adds the kernel's own variance, 2 (.25·1 + .05·4) = 0.9: no octaves, see Yee.
        assert variance == pytest.approx(0.9 * i, rel=1e-4)
