"""Denoising with a sample of the noise: flat becomes flat, texture stays, and light is kept."""

import numpy as np
import pytest

from plateau.metric import Half, VisibleDifferences
from plateau.metric.noise_model import noise_model
from tests.support.images import PAPER

GREY = np.full((96, 96, 3), 0.5, np.float32)
METRIC = VisibleDifferences(PAPER)


def noise(seed, sigma, shape=GREY.shape):
    return np.random.default_rng(seed).normal(0, sigma, shape).astype(np.float32)


class TestTheNoiseModel:
    def test_what_is_too_bright_to_see_makes_no_noise(self):
        lamp, flicker = GREY.copy(), GREY.copy()
        lamp[40:44, 40:44], flicker[40:44, 40:44] = 30, 50
        model = noise_model(METRIC, (lamp + flicker) / 2, (Half(lamp, 8), Half(flicker, 8)))
        assert not model.noise.any()
        assert model.clean.max() == 1

    def test_a_pixel_that_is_not_finite_stays_one_and_spoils_no_other(self):
        image = GREY + noise(1, 0.05)
        image[10, 20] = np.nan
        model = noise_model(METRIC, image, (Half(image, 8), Half(GREY, 8)))
        assert np.argwhere(model.non_finite).tolist() == [[10, 20]]
        assert np.isfinite(model.clean).all()
        assert np.isnan(model.noisy(1)).any(axis=-1).sum() == 1

    def test_signs_give_the_two_halves_of_one_noise(self):
        even, odd = GREY + noise(1, 0.1), GREY + noise(2, 0.1)
        model = noise_model(METRIC, (even + odd) / 2, (Half(even, 8), Half(odd, 8)))
        np.testing.assert_allclose((model.noisy(1) + model.noisy(-1)) / 2, model.clean, atol=1e-6)
        assert model.noise.std() == pytest.approx(0.1 / np.sqrt(2), rel=0.05)

    def test_unequal_halves_give_noise_of_the_same_strength(self):
        # 90 and 10 spp with 0.1 for one sample of the whole.
        even, odd = GREY + noise(1, 0.1 / 90**0.5), GREY + noise(2, 0.1 / 10**0.5)
        image = (90 * even + 10 * odd) / 100
        model = noise_model(METRIC, image, (Half(even, 90), Half(odd, 10)))
        assert model.noise.std() == pytest.approx(0.01, rel=0.05)
