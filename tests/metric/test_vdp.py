import math

import numpy as np
import pytest

from plateau.metric import View, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences
from tests.support.images import PAPER


@pytest.fixture
def noise():
    """Two noisy images of one grey, which the metric calls partly visible."""
    generator = np.random.default_rng(20070401)
    return tuple(
        (0.35 + 0.02 * generator.standard_normal((48, 64, 3))).astype(np.float32) for _ in range(2)
    )


def visible_differences(reference, test, view=None):
    metric = VisibleDifferences(view or View())
    return metric.compare(metric.percept(reference), metric.percept(test))


def grey(height, width, value=0.35):
    return np.full((height, width, 3), value, np.float32)


def test_in_the_dark_colour_is_not_judged(noise):
    # 7 EV down, the grey of 35 cd/m² is under 10 and only luminance counts.
    dark = View(exposure_ev=-7)
    dark_luminance_only = View(exposure_ev=-7, luminance_only=True)
    assert visible_differences(*noise, PAPER).count > visible_differences(*noise, dark).count
    assert np.array_equal(
        visible_differences(*noise, dark).visible,
        visible_differences(*noise, dark_luminance_only).visible,
    )


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
def test_flat_areas_differ_from_however_far_they_are_seen(predictor):
    # Of the finest bands nobody sees anything at 1,600 pixels in 2 degrees
    image = np.concatenate([grey(64, 800, 0.2), grey(64, 800, 0.5)], axis=1)
    for field_of_view_deg in (45.0, 2.0, 0.05):
        judge = predictor(View(field_of_view_deg=field_of_view_deg))
        assert judge.compare(judge.percept(image), judge.percept(image * 1.15)).fraction > 0.9


@pytest.mark.parametrize(("field_of_view_deg", "level"), [(17, 5), (45, 6), (60, 7), (120, 7)])
def test_the_adaptation_level_follows_the_field_of_view(field_of_view_deg, level):
    metric = VisibleDifferences(View(field_of_view_deg=field_of_view_deg))
    assert metric.adaptation_level(256) == level


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
def test_pixels_per_degree_give_the_angle_of_an_image_of_any_width(predictor, noise):
    by_pixels = predictor(View(pixels_per_degree=noise[0].shape[1] / 16))
    by_angle = predictor(View(field_of_view_deg=math.degrees(2 * math.atan(math.radians(16) / 2))))
    seen, same, near = (
        metric.compare(*map(metric.percept, noise)).visible
        for metric in (by_pixels, by_angle, predictor(View(field_of_view_deg=120)))
    )
    np.testing.assert_array_equal(seen, same)
    assert (seen != near).any()
    # An image twice as wide fills twice the angle, and one level more is blurred by a degree
    assert (by_pixels.frequencies_cpd(64) == by_pixels.frequencies_cpd(2048)).all()
    assert by_pixels.adaptation_level(noise[0].shape[1]) == 5
    assert by_pixels.adaptation_level(2 * noise[0].shape[1]) == 6
