"""By a target in JOD, the next samples go where they take away most of what ColorVideoVDP sees."""

from dataclasses import replace

import numpy as np
import pytest

from plateau.metric import Evidence, Half, View
from plateau.metric.allocation import LARGE_ROUNDS, LEAST_SHARE, SMALL_ROUNDS
from plateau.metric.blend import BlendError
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.cvvdp.parameters import DIFFERENCE_EXPONENT, EPSILON
from plateau.metric.display import displayed
from plateau.metric.quality import QualityModel, display_of
from plateau.metric.quality_allocation import plan_by_quality
from tests.metric.test_allocation import METRIC, SIZE, Film, film

VIEW = View(pixels_per_degree=20.0)
EVEN, NOISY = 0.05, 0.3


def plan(one, target=9.5, planned=None, model=None, sizes=SMALL_ROUNDS):
    model = one.judged()[0] if model is None else model
    planned = one.spp if planned is None else planned
    return plan_by_quality(
        model, VIEW, target, spp=one.spp, planned=planned, size=SIZE, sizes=sizes
    )


def lopsided(shape=(64, 64)):
    """A film with a noisy upper right quarter."""
    sigma = np.full(shape, EVEN)
    sigma[: shape[0] // 2, shape[1] // 2 :] = NOISY
    return film(sigma)


def clean_and_noisy(one):
    model = one.judged()[0]
    eye = ColorVideoVDP(display_of(VIEW, model.clean.shape[1]))
    images = model.clean, model.finite_noisy(1)
    return eye, [eye.percept(displayed(image, VIEW)) for image in images]


@pytest.mark.parametrize("shape", [(64, 64), (40, 56)])
def test_the_zones_add_up_to_the_whole(shape):
    eye, pair = clean_and_noisy(lopsided(shape))
    found, whole = (eye.compare(*pair, zone_size=size) for size in (SIZE, 1024))
    assert found.zones.shape == (2, *(-(-side // SIZE) for side in shape))
    np.testing.assert_allclose(found.zones.sum(axis=(1, 2)), whole.zones[:, 0, 0], rtol=1e-12)
    # A band's D is pooled as (mean(D² + 2εD) + ε)^½ - ε^½, and mean(D) ≤ mean(D²)^½
    bands = found.differences[:, :-1]
    squares = (bands + EPSILON**0.5) ** 2 - EPSILON
    most = (squares**2).sum()
    least = (np.maximum(squares - 2 * EPSILON * squares**0.5, 0) ** 2).sum()
    assert least * (1 - 1e-6) <= found.zones[0].sum() <= most * (1 + 1e-6)
    assert least > most * (1 - 1e-5)
    assert (found.zones[1] <= found.zones[0]).all()
    assert (found.jod, found.heat) == (eye.compare(*pair).jod, None)


@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.0])
def test_the_marginal_is_what_the_loss_falls_by(sigma):
    model = film(np.full((64, 64), sigma)).judged()[0]
    now, less = (
        QualityModel(replace(model, noise=model.noise * np.float32(amount)), VIEW, zone_size=SIZE)
        for amount in (1, 0.99)
    )
    lost, falls = now.quality.zones.sum(axis=(1, 2))
    power = np.log(less.quality.zones[0].sum() / lost) / (-2 * np.log(0.99))
    # By the logarithm of the samples, of which the noise is n^-½; that of little noise is -2p
    assert power == pytest.approx(-2 * DIFFERENCE_EXPONENT * falls / lost, rel=0.01)
    assert (falls / lost < 0.5) == (sigma == 1.0)


def test_the_noisy_quarter_is_chosen_and_needs_more():
    one = lopsided()
    first, second = plan(one), plan(one)
    assert first.zones[:2, 2:].any()
    assert not first.zones[:, :2].any()
    assert not first.zones[2:].any()
    assert first.needed[:2, 2:].min() > 1.5 * first.needed[2:].max()
    # The last sample of each zone that grows takes away equally much, and the target is met
    quality = QualityModel(one.judged()[0], VIEW, zone_size=SIZE).quality
    (lost, falls), grown = quality.zones, first.needed / one.spp
    prices = (falls * grown ** -(1 + DIFFERENCE_EXPONENT))[grown > 1]
    assert prices == pytest.approx(prices[0], rel=1e-9)
    left = (lost * grown**-DIFFERENCE_EXPONENT).sum() / lost.sum()
    assert left == pytest.approx(0.95 * (0.5 / (10 - quality.jod)) ** (2 / 0.9302), rel=1e-3)
    assert (first.spp, first.zones.tolist()) == (second.spp, second.zones.tolist())
    assert (first.needed == second.needed).all()


def test_equal_noise_has_equal_shares():
    rng = np.random.default_rng(2)
    tile = rng.normal(0, 1, (2, SIZE, SIZE, 3)) * 10
    one = film(np.full((64, 64), EVEN))
    one.sums = 0.4 * 50 + np.tile(np.concatenate([tile, tile[:, ::-1]], axis=1), (1, 2, 4, 1)) / 4
    needed = plan(one).needed
    assert needed.min() > 1.5 * 100
    assert needed.max() < 1.15 * needed.min()  # zones at the border have a mirror beside them


def test_what_is_needed_is_enough():
    one = lopsided()
    for _ in range(4):  # the next image knows better
        needed = np.ceil(plan(one).needed).astype(np.int64)
        one = Film(one.sigma, 3)
        for spp in np.unique(needed):
            one.add(needed == spp, int(spp))
    eye, truth = ColorVideoVDP(display_of(VIEW, 64)), np.full((64, 64, 3), 0.4, np.float32)
    image = one.sums.sum(axis=0) / one.of_pixels(one.spp)[..., np.newaxis]
    pair = (eye.percept(displayed(each.astype(np.float32), VIEW)) for each in (truth, image))
    assert eye.compare(*pair).jod == pytest.approx(9.5, abs=0.1)


def test_samples_in_flight_are_counted():
    one = lopsided()
    before = plan(one)
    flying = one.spp + before.zones * 10_000
    after = plan(one, planned=flying)
    assert not (before.zones & after.zones).any()
    assert (after.needed >= flying).all()
    assert after.needed.mean() >= 1.0249 * flying.mean()


@pytest.mark.parametrize("sizes", [SMALL_ROUNDS, LARGE_ROUNDS])
@pytest.mark.parametrize("target", [1.0, 9.5, 9.99, 10.0])
def test_a_round_is_neither_tiny_nor_huge(target, sizes):
    one = lopsided()
    found = plan(one, target, sizes=sizes)
    samples = found.spp * one.of_pixels(found.zones).mean()
    assert max(sizes.least * one.mean, 1) <= samples <= 1.5 * sizes.largest * one.mean
    if target == 1.0:  # long reached
        assert samples <= 2 * sizes.least * one.mean


def test_a_zone_is_never_forgotten_and_fireflies_do_not_have_everything():
    one = film(np.full((64, 64), EVEN))
    one.sums[0, 17:30:4, 17:30:4] += 1000
    assert plan(one).zones[1, 1]
    assert plan(one).spp <= SMALL_ROUNDS.of_zone * 100
    calm = film(np.pad(np.full((32, 32), 1.0), ((0, 32), (32, 0))))
    needed = plan(calm, 9.95).needed
    assert needed.min() == pytest.approx(LEAST_SHARE * needed.mean(), rel=0.1)
    assert needed.min() > 100


def test_black_and_broken_images_and_small_ones_have_a_plan():
    black = film(np.zeros((40, 56)))
    black.sums[:] = 0
    found = plan(black)
    assert found.zones.any()
    assert (found.needed == 100).all()
    assert found.spp >= 1
    broken = lopsided((40, 56))
    broken.sums[:, 3, 3], broken.sums[0, 30:34, 50:] = np.nan, np.inf
    assert plan(broken).zones[:2, 2:].any()
    assert np.isfinite(plan(broken).needed).all()
    with pytest.raises(ValueError, match="zones"):
        plan(black, planned=np.ones((2, 2), np.int64))
    pixel = np.full((3, 8, 3), 0.4, np.float32)
    small = Evidence(100, pixel, (Half(pixel, 50), Half(pixel, 50)), METRIC)
    spp = np.full((1, 1), 100)
    assert small.allocation(0.01, spp=spp, planned=spp, size=SIZE, quality_target=9.5).zones.all()


def test_a_denoised_image_goes_where_its_error_may_be_greater():
    one, other = lopsided(), film(np.fliplr(lopsided().sigma) * 2)
    image = np.full((64, 64, 3), 0.4, np.float32)
    error = BlendError(one.judged()[0], other.judged()[0])
    seen = Evidence(100, image, None, CompiledVisibleDifferences(VIEW), error=error)
    rounds = [
        seen.allocation(0.01, spp=one.spp, planned=one.spp, size=SIZE, quality_target=target)
        for target in (9.9, 1.5)
    ]
    assert rounds[0].zones[:2, 2:].any()
    assert not rounds[0].zones[:2, :2].any()
    assert rounds[1].zones[:2, :2].any()
    assert rounds[0].spp * one.of_pixels(rounds[0].zones).mean() >= LARGE_ROUNDS.least * 100
