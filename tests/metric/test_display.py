import math

import numpy as np
import pytest

from plateau.metric import View, encode_srgb
from plateau.metric.display import as_image, displayed, finite_pixels, opponent_chroma, tristimulus
from tests.support.images import PAPER


def pixel(*channels):
    return np.array(channels, np.float32).reshape(1, 1, 3)


class TestView:
    @pytest.mark.parametrize(
        ("parameter", "value"),
        [
            ("field_of_view_deg", 0),
            ("field_of_view_deg", 180),
            ("field_of_view_deg", math.nan),
            ("pixels_per_degree", 0),
            ("pixels_per_degree", 1001),
            ("pixels_per_degree", math.nan),
            ("primaries", "rec2020"),
            ("gamma", 0),
            ("gamma", -2.2),
            ("gamma", math.nan),
        ],
    )
    def test_what_no_screen_shows_is_refused_by_name(self, parameter, value):
        with pytest.raises(ValueError, match=parameter):
            View(**{parameter: value})


class TestDisplayed:
    @pytest.mark.parametrize("ev", [-3, -0.5, 0, 1])
    def test_a_stop_doubles_the_light(self, ev):
        shown = displayed(pixel(0.1, 0.2, 0.4), View(exposure_ev=ev))
        np.testing.assert_allclose(shown, pixel(0.1, 0.2, 0.4) * 2**ev, rtol=1e-6)

    def test_the_screen_clips_at_black_and_white(self):
        shown = displayed(pixel(-1, 1.5, np.inf), PAPER)
        assert shown.ravel().tolist() == [0, 1, 1]

    def test_a_value_too_large_to_expose_is_white(self):
        assert displayed(pixel(3e38, 3e38, 3e38), View(exposure_ev=10)).min() == 1

    def test_gamma_comes_before_exposure(self):
        shown = displayed(pixel(0.5, 0.5, 0.5), View(gamma=2.2, exposure_ev=1))
        np.testing.assert_allclose(shown, 2 * 0.5**2.2, rtol=1e-6)

    def test_it_is_float32_and_leaves_its_input_alone(self):
        image = pixel(-1, 0.5, 2)
        before = image.copy()
        assert displayed(image, View(exposure_ev=1, gamma=1.8)).dtype == np.float32
        assert np.array_equal(image, before)


class TestColour:
    @pytest.mark.parametrize("primaries", ["rec709", "adobe1998"])
    def test_white_has_unit_luminance_and_no_chroma(self, primaries):
        xyz = tristimulus(np.ones((2, 3, 3), np.float32), primaries)
        np.testing.assert_allclose(xyz[1], 1, atol=2e-6)
        np.testing.assert_allclose(opponent_chroma(xyz, primaries), 0, atol=1e-4)

    @pytest.mark.parametrize("grey", [0, 1e-4, 0.005, 0.0089, 0.2])
    def test_grey_has_no_chroma_on_either_side_of_the_straight_piece(self, grey):
        xyz = tristimulus(np.full((1, 1, 3), grey, np.float32), "rec709")
        np.testing.assert_allclose(opponent_chroma(xyz, "rec709"), 0, atol=1e-3)

    @pytest.mark.parametrize(
        ("rgb", "a_b"),
        # The CIELAB coordinates of the sRGB primaries, as commonly tabulated.
        [((1, 0, 0), (80.1, 67.2)), ((0, 1, 0), (-86.2, 83.2)), ((0, 0, 1), (79.2, -107.9))],
    )
    def test_the_rec709_primaries_lie_where_tables_have_them(self, rgb, a_b):
        chroma = opponent_chroma(tristimulus(pixel(*rgb), "rec709"), "rec709")
        np.testing.assert_allclose(chroma.ravel(), a_b, atol=0.1)

    def test_luminance_weighs_the_channels(self):
        assert tristimulus(pixel(1, 0, 0), "rec709")[1] == np.float32(0.2126)
        assert tristimulus(pixel(1, 0, 0), "adobe1998")[1] == np.float32(0.297361)


class TestAsImage:
    @pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (4, 4, 1), (0, 4, 3), (1, 4, 4, 3)])
    def test_only_three_channels_make_an_image(self, shape):
        with pytest.raises(ValueError, match=r"\(H, W, 3\)"):
            as_image(np.zeros(shape))

    def test_other_dtypes_become_float32(self):
        assert as_image(np.ones((1, 1, 3), np.uint8)).dtype == np.float32


def test_one_bad_channel_makes_a_bad_pixel():
    image = np.zeros((2, 2, 3), np.float32)
    image[0, 0, 0], image[0, 1, 1], image[1, 0, 2] = np.nan, np.inf, -np.inf
    assert finite_pixels(image).tolist() == [[False, False], [False, True]]


class TestEncodeSrgb:
    @pytest.mark.parametrize("code", [0, 1, 10, 11, 64, 127, 128, 200, 254, 255])
    def test_it_inverts_the_decoding_of_every_code(self, code):
        value = code / 255
        linear = value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
        assert encode_srgb(pixel(linear, linear, linear)).ravel().tolist() == [code] * 3

    def test_the_exposure_applies(self):
        assert np.array_equal(
            encode_srgb(pixel(0.1, 0.2, 0.4), 1), encode_srgb(pixel(0.2, 0.4, 0.8))
        )

    def test_what_is_no_number_is_black_and_what_is_too_bright_is_white(self):
        assert encode_srgb(pixel(np.nan, np.inf, -1)).ravel().tolist() == [0, 255, 0]
