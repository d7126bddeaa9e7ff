"""The half-buffer estimate against noise of which the truth is known.

All noise is Gaussian and independent, with fixed seeds: the tests cannot fail by chance. A flat
grey masks nothing, so that noise which masks itself would show.
"""

import numpy as np
import pytest

from plateau.metric import Evidence, Half, View, VisibleDifferences

METRIC = VisibleDifferences(View())
TRUTH = np.full((128, 128, 3), 0.35, np.float32)


def render(seed, even_spp, odd_spp, sigma, truth=TRUTH):
    """A merged image and its halves, of samples with this standard deviation."""
    generator = np.random.default_rng(seed)
    halves = tuple(
        Half(truth + (sigma / spp**0.5 * generator.standard_normal(truth.shape)).astype("f4"), spp)
        for spp in (even_spp, odd_spp)
    )
    total = sum(half.spp * half.mean.astype(np.float64) for half in halves)
    return (total / (even_spp + odd_spp)).astype(np.float32), halves


def estimated(image, halves):
    return Evidence(halves[0].spp + halves[1].spp, image, halves, METRIC).estimate


def visible_fraction(reference, test):
    return METRIC.compare(METRIC.percept(reference), METRIC.percept(test)).fraction


@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.2, 0.5])
@pytest.mark.parametrize(("even_spp", "odd_spp"), [(50, 50), (60, 40), (80, 20)])
def test_it_is_the_truth(sigma, even_spp, odd_spp):
    renders = [render(seed, even_spp, odd_spp, sigma) for seed in range(4)]
    truth = np.mean([visible_fraction(TRUTH, image) for image, _ in renders])
    found = np.mean([estimated(*one).fraction for one in renders])
    assert found == pytest.approx(truth, rel=0.08)


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.5])
def test_nor_does_texture_that_masks_by_itself_mislead_it(sigma):
    grain = np.random.default_rng(8).uniform(0.15, 0.55, (128, 128, 1)).astype(np.float32)
    truth = np.broadcast_to(grain, TRUTH.shape)
    image, halves = render(9, 50, 50, sigma, truth)
    ratio = estimated(image, halves).fraction / visible_fraction(truth, image)
    assert ratio == pytest.approx(1, abs=0.05)


def test_pixels_and_fraction_agree_and_the_halves_can_be_exchanged():
    image, halves = render(4, 60, 40, 0.1)
    estimate = estimated(image, halves)
    assert estimate.fraction == estimate.pixels / (128 * 128)
    assert estimated(image, halves[::-1]) == estimate


@pytest.mark.parametrize("spp", [(5, 5), (6, 4)])
def test_a_pixel_that_is_not_finite_is_left_out_and_counted_apart(spp):
    bad = TRUTH.copy()
    bad[3, 4] = [np.nan, np.inf, 1]
    estimate = estimated(bad, (Half(bad, spp[0]), Half(TRUTH, spp[1])))
    assert (estimate.pixels, estimate.non_finite) == (0, 1)
    assert not estimate.visible.any()


@pytest.mark.parametrize("spp", [(5, 5), (6, 4)])
def test_halves_of_another_size_are_refused(spp):
    small = TRUTH[:64]
    with pytest.raises(ValueError, match="a half has shape"):
        estimated(TRUTH, (Half(small, spp[0]), Half(small, spp[1])))


def test_a_half_without_samples_is_refused():
    with pytest.raises(ValueError, match="at least 1 spp"):
        Half(TRUTH, 0)
