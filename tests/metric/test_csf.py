import math

import numpy as np
import pytest

from plateau.metric.csf import contrast_sensitivity, luminance_threshold, masking


def barten(frequency, luminance):
    """The formula as printed, in double precision."""
    a = 440 * (1 + 0.7 / luminance) ** -0.2
    b = 0.3 * (1 + 100 / luminance) ** 0.15
    c = frequency
    return a * c * math.exp(-b * c) * math.sqrt(1 + 0.06 * math.exp(b * c))


class TestContrastSensitivity:
    @pytest.mark.parametrize("luminance", [1e-5, 0.01, 1, 100, 10_000])
    @pytest.mark.parametrize("frequency", [0.05, 0.5, 3.248, 20, 60])
    def test_it_is_the_printed_formula(self, frequency, luminance):
        expected = barten(frequency, luminance)
        assert float(contrast_sensitivity(frequency, luminance)) == pytest.approx(
            expected, rel=2e-5, abs=1e-30
        )

    @pytest.mark.parametrize(
        ("frequency", "luminance"), [(0, 100), (4, 0), (0, 0), (math.inf, 100), (1e6, 1)]
    )
    def test_its_limits_are_zero(self, frequency, luminance):
        assert contrast_sensitivity(frequency, luminance) == 0

    def test_bright_light_has_a_limit_of_its_own(self):
        assert float(contrast_sensitivity(4, math.inf)) == pytest.approx(barten(4, 1e12), rel=1e-5)

    @pytest.mark.parametrize(
        ("frequency", "luminance"),
        [(math.nan, 1), (1, math.nan), (math.nan, 0), (0, math.nan), (-1, 1), (1, -0.1), (1, -9)],
    )
    def test_outside_its_domain_it_is_nan(self, frequency, luminance):
        assert np.isnan(contrast_sensitivity(frequency, luminance))


class TestLuminanceThreshold:
    @pytest.mark.parametrize(
        ("log_luminance", "log_threshold"),
        [
            (-6, -2.86),
            (-2, (0.405 * -2 + 1.6) ** 2.18 - 2.86),
            (-1, -1.395),
            (0, 0.65**2.7 - 0.72),
            (1, 0.899**2.7 - 0.72),
            (2, 0.745),
            (4, 2.745),
        ],
    )
    def test_each_piece_is_the_printed_one(self, log_luminance, log_threshold):
        threshold = luminance_threshold(10.0**log_luminance)
        assert float(threshold) == pytest.approx(10**log_threshold, rel=1e-5)

    def test_in_full_darkness_it_is_the_rods_own(self):
        assert float(luminance_threshold(0)) == pytest.approx(10**-2.86, rel=1e-6)

    def test_at_infinity_it_is_infinite(self):
        assert np.isposinf(luminance_threshold(math.inf))

    @pytest.mark.parametrize("luminance", [math.nan, -1])
    def test_outside_its_domain_it_is_nan(self, luminance):
        assert np.isnan(luminance_threshold(luminance))


class TestMasking:
    @pytest.mark.parametrize("contrast", [0.01, 0.3, 1, 7, 1000])
    def test_it_is_the_printed_formula(self, contrast):
        expected = (1 + (0.0153 * (392.498 * contrast) ** 0.7) ** 4) ** 0.25
        assert float(masking(contrast)) == pytest.approx(expected, rel=1e-6)

    def test_without_a_pattern_nothing_is_raised(self):
        assert masking(0) == 1

    def test_an_overwhelming_pattern_masks_everything(self):
        assert np.isposinf(masking(math.inf))

    @pytest.mark.parametrize("contrast", [math.nan, -1])
    def test_outside_its_domain_it_is_nan(self, contrast):
        assert np.isnan(masking(contrast))
