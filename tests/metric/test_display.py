import math

import numpy as np
import pytest

from plateau.metric import View, encode_srgb
from plateau.metric.display import as_image, opponent_chroma, tristimulus


def pixel(*channels):
    return np.array(channels, np.float32).reshape(1, 1, 3)


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
def test_a_view_that_no_screen_shows_is_refused_by_name(parameter, value):
    with pytest.raises(ValueError, match=parameter):
        View(**{parameter: value})


class TestColour:
    @pytest.mark.parametrize("primaries", ["rec709", "adobe1998"])
    def test_white_has_unit_luminance_and_no_chroma(self, primaries):
        xyz = tristimulus(np.ones((2, 3, 3), np.float32), primaries)
        np.testing.assert_allclose(xyz[1], 1, atol=2e-6)
        np.testing.assert_allclose(opponent_chroma(xyz, primaries), 0, atol=1e-4)

    @pytest.mark.parametrize(
        ("rgb", "a_b"),
        # The CIELAB coordinates of the sRGB primaries, as commonly tabulated.
        [((1, 0, 0), (80.1, 67.2)), ((0, 1, 0), (-86.2, 83.2)), ((0, 0, 1), (79.2, -107.9))],
    )
    def test_the_rec709_primaries_lie_where_tables_have_them(self, rgb, a_b):
        chroma = opponent_chroma(tristimulus(pixel(*rgb), "rec709"), "rec709")
        np.testing.assert_allclose(chroma.ravel(), a_b, atol=0.1)


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (4, 4, 1), (0, 4, 3), (1, 4, 4, 3)])
def test_only_three_channels_make_an_image(shape):
    with pytest.raises(ValueError, match=r"\(H, W, 3\)"):
        as_image(np.zeros(shape))


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
