"""By a target in JOD, the next samples go where they take away most of what ColorVideoVDP sees."""

from dataclasses import replace

import numpy as np
import pytest

from plateau.metric import Evidence, Half
from plateau.metric.allocation import LARGE_ROUNDS, LEAST_SHARE, SMALL_ROUNDS
from plateau.metric.blend import BlendError
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.cvvdp.parameters import DIFFERENCE_EXPONENT, EPSILON
from plateau.metric.display import displayed
from plateau.metric.quality import QualityModel, display_of
from tests.metric.test_allocation import METRIC, NEAR, SIZE, Film, film


def lopsided(shape=(64, 64)):
    """A film with a noisy upper right quarter."""
    sigma = np.full(shape, 0.05)
    sigma[: shape[0] // 2, shape[1] // 2 :] = 0.3
    return film(sigma)


@pytest.mark.parametrize("shape", [(64, 64), (40, 56)])
def test_the_zones_add_up_to_the_whole(shape):
    model = lopsided(shape).judged()[0]
    eye = ColorVideoVDP(display_of(NEAR, shape[1]))
    images = model.clean, model.finite_noisy(1)
    pair = [eye.percept(displayed(image, NEAR)) for image in images]
    found, whole = (eye.compare(*pair, zone_size=size) for size in (SIZE, 1024))
    np.testing.assert_allclose(found.zones.sum(axis=(1, 2)), whole.zones[:, 0, 0], rtol=1e-12)
    # A band's D is pooled as (mean(D² + 2εD) + ε)^½ - ε^½, and mean(D) ≤ mean(D²)^½
    squares = (found.differences[:, :-1] + EPSILON**0.5) ** 2 - EPSILON
    most, least = (
        ((squares - np.minimum(squares, off * squares**0.5)) ** 2).sum() for off in (0, 2 * EPSILON)
    )
    assert least * (1 - 1e-6) <= found.zones[0].sum() <= most * (1 + 1e-6)
    assert least > most * (1 - 1e-5)
    assert (found.jod, found.heat) == (eye.compare(*pair).jod, None)


@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.0])
def test_the_marginal_is_what_the_loss_falls_by(sigma):
    model = film(np.full((64, 64), sigma)).judged()[0]
    now, less = (
        QualityModel(replace(model, noise=model.noise * np.float32(amount)), NEAR, zone_size=SIZE)
        for amount in (1, 0.99)
    )
    lost, falls = now.quality.zones.sum(axis=(1, 2))
    power = np.log(less.quality.zones[0].sum() / lost) / (-2 * np.log(0.99))
    # By the logarithm of the samples, of which the noise is n^-½; that of little noise is -2p
    assert power == pytest.approx(-2 * DIFFERENCE_EXPONENT * falls / lost, rel=0.01)
    assert (falls / lost < 0.5) == (sigma == 1.0)


def test_the_last_sample_of_each_zone_takes_away_equally_much():
    one = lopsided()
    quality = QualityModel(one.judged()[0], NEAR, zone_size=SIZE).quality
    (lost, falls), grown = quality.zones, one.plan(9.5).needed / one.spp
    prices = (falls * grown ** -(1 + DIFFERENCE_EXPONENT))[grown > 1]
    assert prices == pytest.approx(prices[0], rel=1e-9)
    left = (lost * grown**-DIFFERENCE_EXPONENT).sum() / lost.sum()
    assert left == pytest.approx(0.95 * (0.5 / (10 - quality.jod)) ** (2 / 0.9302), rel=1e-3)


def test_equal_noise_has_equal_shares():
    rng = np.random.default_rng(2)
    tile = rng.normal(0, 1, (2, SIZE, SIZE, 3)) * 10
    one = film(np.full((64, 64), 0.05))
    one.sums = 0.4 * 50 + np.tile(np.concatenate([tile, tile[:, ::-1]], axis=1), (1, 2, 4, 1)) / 4
    needed = one.plan(9.5).needed
    assert needed.min() > 1.5 * 100
    assert needed.max() < 1.15 * needed.min()  # zones at the border have a mirror beside them


def test_what_is_needed_is_enough():
    one = lopsided()
    for _ in range(4):  # the next image knows better
        needed = np.ceil(one.plan(9.5).needed).astype(np.int64)
        one = Film(one.sigma, 3)
        for spp in np.unique(needed):
            one.add(needed == spp, int(spp))
    eye, truth = ColorVideoVDP(display_of(NEAR, 64)), np.full((64, 64, 3), 0.4, np.float32)
    image = one.sums.sum(axis=0) / one.of_pixels(one.spp)[..., np.newaxis]
    pair = (eye.percept(displayed(each.astype(np.float32), NEAR)) for each in (truth, image))
    assert eye.compare(*pair).jod == pytest.approx(9.5, abs=0.1)


def test_a_zone_is_never_forgotten_and_fireflies_do_not_have_everything():
    one = film(np.full((64, 64), 0.05))
    one.sums[0, 17:30:4, 17:30:4] += 1000
    assert one.plan(9.5).zones[1, 1]
    assert one.plan(9.5).spp <= SMALL_ROUNDS.of_zone * 100
    calm = film(np.pad(np.full((32, 32), 1.0), ((0, 32), (32, 0))))
    needed = calm.plan(9.95).needed
    assert needed.min() == pytest.approx(LEAST_SHARE * needed.mean(), rel=0.1)
    assert needed.min() > 100


def test_black_and_broken_images_and_small_ones_have_a_plan():
    black, broken = film(np.zeros((40, 56))), lopsided((40, 56))
    black.sums[:] = 0
    assert (black.plan(9.5).needed == 100).all()
    broken.sums[:, 3, 3], broken.sums[0, 30:34, 50:] = np.nan, np.inf
    found = broken.plan(9.5)
    assert found.zones[:2, 2:].any()
    assert np.isfinite(found.needed).all()
    pixel, spp = np.full((3, 8, 3), 0.4, np.float32), np.full((1, 1), 100)
    small = Evidence(100, pixel, (Half(pixel, 50), Half(pixel, 50)), METRIC)
    assert small.allocation(0.01, spp=spp, planned=spp, size=SIZE, quality_target=9.5).zones.all()


def test_a_denoised_image_goes_where_its_error_may_be_greater():
    one, other = lopsided(), film(np.fliplr(lopsided().sigma) * 2)
    image = np.full((64, 64, 3), 0.4, np.float32)
    error = BlendError(one.judged()[0], other.judged()[0])
    seen = Evidence(100, image, None, CompiledVisibleDifferences(NEAR), error=error)
    likely, greater = (
        seen.allocation(0.01, spp=one.spp, planned=one.spp, size=SIZE, quality_target=target)
        for target in (9.9, 1.5)
    )
    assert likely.zones[:2, 2:].any()
    assert not likely.zones[:2, :2].any()
    assert greater.zones[:2, :2].any()
    assert likely.spp * one.of_pixels(likely.zones).mean() >= LARGE_ROUNDS.least * 100
