import math

import numpy as np
import pytest

from plateau.metric import View, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences


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


def test_an_image_does_not_differ_from_itself(noise):
    difference = visible_differences(noise[0], noise[0].copy())
    assert difference.count == 0
    assert difference.fraction == 0
    assert not difference.visible.any()


def test_the_map_the_count_and_the_fraction_agree(noise):
    difference = visible_differences(*noise)
    assert difference.visible.shape == (48, 64)
    assert difference.visible.dtype == bool
    assert difference.count == difference.visible.sum()
    assert difference.fraction == difference.count / (48 * 64)
    assert difference.non_finite == 0


@pytest.mark.parametrize("value", [0.05, 0.95])
def test_a_patch_is_seen_where_it_is_whether_darker_or_brighter(value):
    reference, test = grey(64, 64), grey(64, 64)
    test[20:30, 40:45] = value
    visible = visible_differences(reference, test).visible
    assert visible[20:30, 40:45].all()
    assert visible.sum() == 50


def test_a_brighter_screen_shows_more(noise):
    dim, bright = (
        visible_differences(*noise, View(white_luminance=luminance)).count
        for luminance in (20, 100)
    )
    assert dim == 0
    assert bright > 0


def test_in_the_dark_colour_is_not_judged(noise):
    # 7 EV down, the grey of 35 cd/m² is under 10 and only luminance counts.
    dark = View(exposure_ev=-7)
    dark_luminance_only = View(exposure_ev=-7, luminance_only=True)
    assert visible_differences(*noise, View()).count > visible_differences(*noise, dark).count
    assert np.array_equal(
        visible_differences(*noise, dark).visible,
        visible_differences(*noise, dark_luminance_only).visible,
    )


def test_a_colour_of_equal_luminance_shows_unless_luminance_alone_is_judged():
    reference, test = grey(32, 32, 0.5), grey(32, 32, 0.5)
    red, green = np.float32(0.2126), np.float32(0.7152)
    test[8:16, 8:16, 0] += np.float32(0.2)
    test[8:16, 8:16, 1] -= np.float32(0.2) * red / green
    assert visible_differences(reference, test).count == 64
    assert visible_differences(reference, test, View(luminance_only=True)).count == 0


class TestNonFinitePixels:
    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    @pytest.mark.parametrize("which", ["reference", "test", "both"])
    def test_they_are_counted_and_visible_and_poison_nothing_else(self, noise, value, which):
        reference, test = noise[0].copy(), noise[1].copy()
        bad, black = [], []
        for image, name in ((reference, "reference"), (test, "test")):
            bad.append(image.copy())
            black.append(image.copy())
            if which in (name, "both"):
                bad[-1][20, 30, 1] = value
                black[-1][20, 30] = 0

        difference = visible_differences(*bad)

        assert difference.non_finite == 1
        assert difference.visible[20, 30]
        # Everywhere else it is as if the pixel were black.
        expected = visible_differences(*black).visible
        expected[20, 30] = True
        assert np.array_equal(difference.visible, expected)

    def test_a_pixel_that_is_bad_in_both_counts_once(self, noise):
        bad = [image.copy() for image in noise]
        bad[0][0, 0], bad[1][0, 0], bad[1][5, 5] = np.nan, np.inf, np.nan
        assert visible_differences(*bad).non_finite == 2

    def test_nothing_but_nan_is_all_visible(self):
        difference = visible_differences(grey(4, 4, np.nan), grey(4, 4))
        assert (difference.count, difference.non_finite, difference.fraction) == (16, 16, 1.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2), (3, 1), (1, 64)])
def test_tiny_images_are_judged_too(shape):
    black, white = grey(*shape, 0.0), grey(*shape, 1.0)
    assert visible_differences(black, white).count == shape[0] * shape[1]
    assert visible_differences(white, white).count == 0


def test_extreme_radiance_is_clipped_without_a_warning():
    assert visible_differences(grey(8, 8, 1e30), grey(8, 8, 1.0)).count == 0
    assert visible_differences(grey(8, 8, -1e30), grey(8, 8, 0.0)).count == 0
    assert visible_differences(grey(8, 8, 1.0), grey(8, 8, 0.0), View(exposure_ev=100)).count == 64


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


def test_the_width_in_degrees_is_that_of_a_flat_screen():
    assert View(field_of_view_deg=45).width_deg(256) == pytest.approx(47.465, abs=5e-4)


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
def test_pixels_per_degree_give_the_angle_of_an_image_of_any_width(predictor, noise):
    by_pixels = predictor(View(field_of_view_deg=120, pixels_per_degree=noise[0].shape[1] / 16))
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
