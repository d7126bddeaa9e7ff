"""The map of samples: more is lighter, and equal ratios are equal steps."""

import numpy as np

from plateau.metric.pictures import SAMPLES_PALETTE, samples_map


def luminance(colours):
    """The relative luminance of sRGB colours, uint8 (N, 3)."""
    codes = colours / 255
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def test_more_is_lighter():
    light = luminance(SAMPLES_PALETTE)
    assert (light[2:] > light[:-2]).all()  # neighbours may be equal when rounded to 8 bits
    assert light[[0, -1]].round(1).tolist() == [0, 0.8]


def test_equal_ratios_are_equal_steps_from_the_fewest_to_the_most():
    codes = samples_map(np.array([[10, 100], [1000, 10_000]]))
    assert codes.tolist() == [[0, 85], [170, 255]]


def test_where_all_are_equal_all_have_the_first_colour():
    assert not samples_map(np.full((3, 4), 80)).any()
