"""Pixels that are NaN or infinite are told apart, and few of them are allowed."""

import numpy as np
import pytest

from plateau.metric.non_finite import allowed_non_finite, non_finite_pixels
from plateau.metric.pictures import MAP_PALETTE, non_finite_map


@pytest.mark.parametrize(
    ("pixels", "allowed"),
    [(1, 2), (768, 2), (2999, 2), (3000, 3), (512 * 512, 262), (1920 * 1080, 2073)],
)
def test_a_thousandth_is_allowed_and_two_in_any_case(pixels, allowed):
    assert allowed_non_finite(pixels) == allowed


def test_a_pixel_with_both_is_nan_and_counts_once():
    image = np.zeros((4, 5, 3), np.float32)
    image[0, 0] = [np.nan, np.inf, 0]
    image[1, 2, 0] = -np.inf
    found = non_finite_pixels(image)
    assert np.argwhere(found.nan).tolist() == [[0, 0]]
    assert np.argwhere(found.infinite).tolist() == [[1, 2]]
    assert found.count == 2


def test_the_map_marks_them_on_the_dimmed_picture():
    image = np.zeros((1, 3, 3), np.float32)
    image[0, 0, 0], image[0, 1, 0] = np.nan, np.inf
    codes = non_finite_map(np.full((1, 3, 3), 255, np.uint8), non_finite_pixels(image))
    assert MAP_PALETTE[codes].tolist() == [[[255, 0, 255], [0, 200, 255], [85, 85, 85]]]
