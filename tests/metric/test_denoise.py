"""Denoising with a sample of the noise: flat becomes flat, texture stays, and light is kept."""

import numpy as np
import pytest

from plateau.metric import Half, VisibleDifferences
from plateau.metric.denoise import denoised
from plateau.metric.noise_model import noise_model
from tests.support.images import PAPER

GREY = np.full((96, 96, 3), 0.5, np.float32)
METRIC = VisibleDifferences(PAPER)


def noise(seed, sigma, shape=GREY.shape):
    return np.random.default_rng(seed).normal(0, sigma, shape).astype(np.float32)


def test_a_flat_area_loses_its_noise():
    left = denoised(GREY + noise(1, 0.1), noise(2, 0.1)) - GREY
    assert left.std() < 0.1 * 0.12


def test_texture_stronger_than_the_noise_stays():
    checks = np.indices((96, 96)).sum(axis=0)[..., np.newaxis] % 2 * np.float32(0.4)
    texture = GREY + checks
    left = denoised(texture + noise(1, 0.05), noise(2, 0.05)) - texture
    assert left.std() < 0.06  # of a texture of 0.2


def test_texture_weaker_than_the_noise_goes():
    checks = np.indices((96, 96)).sum(axis=0)[..., np.newaxis] % 2 * np.float32(0.02)
    assert denoised(GREY + checks + noise(1, 0.1), noise(2, 0.1)).std() < 0.015


def test_without_noise_the_image_stays_as_it_is():
    image = np.random.default_rng(4).random((33, 47, 3), np.float32)
    np.testing.assert_allclose(denoised(image, np.zeros_like(image)), image, atol=1e-6)


def test_no_light_is_lost():
    image = GREY + noise(1, 0.1)
    assert denoised(image, noise(2, 0.1)).mean() == pytest.approx(image.mean(), rel=1e-3)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 40, 3), (40, 1, 3), (2, 3, 3)])
def test_images_narrower_than_the_blur_are_denoised_too(shape):
    clean = denoised(np.full(shape, 0.25, np.float32), noise(1, 0.1, shape))
    np.testing.assert_allclose(clean, 0.25, rtol=1e-5)


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
