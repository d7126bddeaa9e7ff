"""The visible noise of zones is foretold from one sample of noise; doubt stays in the answer."""

import numpy as np
import pytest

from plateau.metric import Half
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import estimate_from
from plateau.metric.noise_model import noise_model
from plateau.metric.zone_noise import GROWTH, zone_curves, zone_sums
from tests.support.images import PAPER

METRIC = CompiledVisibleDifferences(PAPER)
GREY = np.float32(0.4)


def curves(noise, size=16):
    """Return the curves of a grey image whose halves have this noise, (2, H, W, 3)."""
    even, odd = GREY + noise.astype(np.float32)
    model = noise_model(METRIC, (even + odd) / 2, (Half(even, 50), Half(odd, 50)))
    clean = METRIC.percept(model.clean)
    return zone_curves(METRIC, model, clean, estimate_from(METRIC, model, clean), size)


def draws(sigma, seed, shape=(64, 64)):
    """Return noise of two halves, whose standard deviation is given for each pixel or for all."""
    noise = np.random.default_rng(seed).normal(0, 1, (2, *shape, 3))
    return noise * np.broadcast_to(sigma, shape)[..., np.newaxis]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_present_and_the_future_are_those_of_other_noise_of_the_same_kind(seed):
    sigma = np.full((64, 64), 0.05)
    sigma[:, 32:] = 0.025  # the right half is four times as far
    found = curves(draws(sigma, seed))
    truth = METRIC.percept(np.full((64, 64, 3), GREY))
    for growth in (1, 2, 4):
        place = round(np.log(growth) / np.log(GROWTH[1]))
        others = [
            METRIC.compare(
                truth,
                METRIC.percept(GREY + draws(sigma, 100 + other).mean(axis=0) / np.sqrt(growth)),
            ).visible
            for other in range(20)
        ]
        true = zone_sums(np.mean(others, axis=0), 32)
        guess = found.visible[..., place].reshape(2, 2, 2, 2).sum(axis=(1, 3))
        assert guess == pytest.approx(true, rel=0.35, abs=4)


def test_visible_pixels_only_fall():
    visible = curves(draws(0.04, 5)).visible
    assert (np.diff(visible, axis=-1) <= 0).all()
    assert (visible >= 0).all()
    assert (visible <= 256).all()


def test_a_zone_without_visible_pixels_is_not_free_of_doubt():
    sigma = np.full((64, 64), 0.04)
    sigma[16:32, 16:32] = 0
    visible = curves(draws(sigma, 6)).visible[..., 0]
    assert 0 < visible[1, 1] < visible.sum() / 200


def test_a_firefly_shows_in_its_zone_even_after_four_times_the_samples():
    noise = draws(0.005, 7)
    calm = curves(noise).visible[2, 3]
    noise[0, 40:42, 50:52] += 2
    lit = curves(noise).visible[2, 3]
    four_times = round(np.log(4) / np.log(GROWTH[1]))
    assert lit[0] > 3 * calm[0]
    assert lit[four_times] > 3 * calm[four_times]


def test_pixels_that_are_not_finite_are_in_no_zone():
    noise = draws(0.04, 8)
    noise[0, :16, :8] = np.nan
    found = curves(noise)
    assert found.pixels[0].tolist() == [128, 256, 256, 256]
    assert found.visible[0, 0, 0] < 128


def test_zones_at_the_edges_may_be_smaller():
    found = curves(draws(0.04, 9, (40, 50)), size=32)
    assert found.pixels.tolist() == [[1024, 576], [256, 144]]
    assert found.visible.shape == (2, 2, len(GROWTH))


def test_one_zone_unlike_all_others_is_believed():
    sigma = np.full((128, 128), 1e-4)
    sigma[64:80, 64:80] = 0.5
    visible = curves(draws(sigma, 10, sigma.shape)).visible[..., 0]
    assert visible[4, 4] > 100
    assert visible.sum() - visible[4, 4] < 5
