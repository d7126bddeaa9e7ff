"""The blend of an image with its denoised self, on images whose truth is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from plateau.metric import (
    Evidence,
    Half,
    Image,
    NoiseModel,
    View,
    Visible,
    VisibleDifferences,
    blended,
)
from plateau.metric.blend import BlendError
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.denoise import smoothed
from plateau.metric.estimate import estimate_from
from plateau.metric.quality import display_of

VIEW = View(field_of_view_deg=20, white_luminance=100)
SIZE = 128
SPP = 32  # of a half


def blur(image: Image) -> Image:
    """A denoiser that takes all texture for noise."""
    planes = np.ascontiguousarray(np.moveaxis(image, -1, 0))
    for gap in (1, 2, 4):
        planes = smoothed(planes, gap)
    return np.moveaxis(planes, 0, -1)


def nothing(image: Image) -> Image:
    return image


def ramp() -> Image:
    row = np.linspace(0.2, 0.6, SIZE, dtype=np.float32)
    return np.repeat(np.tile(row, (SIZE, 1))[..., np.newaxis], 3, axis=-1)


def texture(period: int) -> Callable[[], Image]:
    def stripes() -> Image:
        dark = np.arange(SIZE) // (period // 2) % 2 == 0
        row = np.where(dark, np.float32(0.3), np.float32(0.5))
        return np.repeat(np.tile(row, (SIZE, 1))[..., np.newaxis], 3, axis=-1)

    return stripes


TRUTHS = {
    "flat": lambda: np.full((SIZE, SIZE, 3), 0.4, np.float32),
    "ramp": ramp,
    "texture finer than the blur": texture(2),
    "texture coarser than the blur": texture(32),
}


Halves = tuple[Half, Half]


def halves(truth: Image, sigma: float, seed: int = 1, share: float = 0.5, reach: int = 0) -> Halves:
    """Two parts of the samples whose mean has noise of so much, which may reach some pixels far."""
    rng = np.random.default_rng(seed)

    def part(share: float) -> Half:
        noise = rng.normal(0, sigma / np.sqrt(share), truth.shape).astype(np.float32)
        if reach:
            near = smoothed(np.moveaxis(noise, -1, 0), 1)
            noise = np.moveaxis(near, 0, -1) * (noise.std() / near.std())
        return Half(truth + noise, 2 * SPP * share)

    return part(share), part(1 - share)


def mean(halves: Halves) -> Image:
    return np.average([one.mean for one in halves], axis=0, weights=[one.spp for one in halves])


def error(image: Image, truth: Image) -> float:
    return float(np.square(image - truth).mean())


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
@pytest.mark.parametrize("sigma", [0.01, 0.05])
def test_it_is_hardly_worse_than_the_better_of_the_two(truth: Image, sigma: float) -> None:
    parts = halves(truth, sigma)
    image = mean(parts)
    blend, _ = blended(image, parts, blur, VIEW)
    better = min(error(image, truth), error(blur(image), truth))
    # The errors are measured, so a little noise stays where there need be none
    assert error(blend.image, truth) < 1.15 * better + 0.03 * error(image, truth)


def test_a_denoiser_that_is_wrong_loses_its_weight_as_samples_come() -> None:
    truth = TRUTHS["texture finer than the blur"]()
    weights = [
        blended(mean(parts), parts, blur, VIEW)[0].weight.mean()
        for parts in (halves(truth, sigma) for sigma in (0.1, 0.025, 0.005))
    ]
    assert weights == sorted(weights, reverse=True)
    assert weights[-1] < 0.01


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
@pytest.mark.parametrize("denoise", [blur, nothing])
@pytest.mark.parametrize("share", [0.5, 0.25])
def test_its_error_is_known_without_the_truth(
    truth: Image, denoise: Callable, share: float
) -> None:
    found, meant, noise = 0.0, 0.0, 0.0
    for seed in range(4):
        parts = halves(truth, 0.05, seed, share)
        blend, judged = blended(mean(parts), parts, denoise, VIEW)
        found += float(np.square(judged.likely.noise).mean())
        meant += error(blend.image, truth)
        noise += error(mean(parts), truth)
    assert 0.75 * meant < found < 1.25 * meant + 0.06 * noise


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
def test_so_are_the_pixels_that_a_person_would_see(truth: Image) -> None:
    metric = VisibleDifferences(VIEW)
    estimated, seen, most, before = 0.0, 0.0, 0.0, 0.0
    light = metric.percept(truth)
    for seed in range(4):
        parts = halves(truth, 0.05, seed)
        blend, judged = blended(mean(parts), parts, blur, VIEW)
        clean = metric.percept(judged.likely.clean)
        estimated += estimate_from(metric, judged.likely, clean).pixels
        most += estimate_from(metric, judged.greatest, clean).pixels
        seen += metric.compare(light, metric.percept(blend.image)).finite_count
        before += metric.compare(light, metric.percept(mean(parts))).finite_count
    assert 0.8 * seen < estimated < 1.25 * seen + 0.2 * before
    assert most >= max(estimated, seen)


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
def test_so_is_the_quality_and_the_doubt_about_it_that_a_larger_image_has_less_of(
    truth: Image,
) -> None:
    eye, parts = ColorVideoVDP(display_of(VIEW, SIZE)), halves(truth, 0.05)
    blend, judged = blended(mean(parts), parts, blur, VIEW)
    found = Evidence(2 * SPP, blend.image, parts, VisibleDifferences(VIEW), judged).quality
    assert found is not None
    lost = 10 - eye.compare(*map(eye.percept, (truth, np.clip(blend.image, 0, 1)))).jod
    assert 0.85 * lost < 10 - found.jod < 1.3 * lost + 0.02
    assert lost < 10 - found.low_jod < 1.8 * lost + 0.05
    # Given four times the image, seen alike
    density, everything = SIZE / VIEW.width_deg(SIZE), (2, 2, 1)
    view = replace(VIEW, field_of_view_deg=None, pixels_per_degree=density)
    nan = np.zeros((2 * SIZE, 2 * SIZE), bool)
    large = [
        NoiseModel(np.tile(one.clean, everything), np.tile(one.noise, everything), nan)
        for one in (judged.likely, judged.greatest)
    ]
    image = np.tile(blend.image, everything)
    more = Evidence(1, image, None, VisibleDifferences(view), BlendError(*large)).quality
    assert more is not None
    assert more.jod == pytest.approx(found.jod, abs=0.05)
    assert more.low_jod > found.low_jod


@pytest.mark.parametrize("name", ["ramp", "texture finer than the blur"])
def test_so_it_is_where_the_image_is_seen_through_a_curve(name: str) -> None:
    def see(image: Image) -> Image:
        return np.clip(image, 0, None) ** np.float32(0.5)

    truth, found, meant, noise = TRUTHS[name](), 0.0, 0.0, 0.0
    for seed in range(4):
        parts = halves(truth, 0.05, seed)
        blend, judged = blended(mean(parts), parts, blur, VIEW, see=see)
        np.testing.assert_array_equal(blend.seen, see(blend.image))
        np.testing.assert_allclose(judged.likely.clean, blend.seen, atol=1e-6)
        found += float(np.square(judged.likely.noise).mean())
        meant += error(blend.seen, see(truth))
        noise += error(see(mean(parts)), see(truth))
    assert 0.75 * meant < found < 1.25 * meant + 0.06 * noise


def test_so_it_is_where_a_filter_spreads_noise() -> None:
    truth, found, meant = ramp(), 0.0, 0.0
    for seed in range(4):
        parts = halves(truth, 0.05, seed, reach=2)
        blend, judged = blended(mean(parts), parts, blur, VIEW)
        found += float(np.square(judged.likely.noise).mean())
        meant += error(blend.image, truth)
    assert 0.75 * meant < found < 1.25 * meant


def test_pixels_that_no_denoiser_mends_stay_and_hurt_no_others() -> None:
    truth = TRUTHS["flat"]()
    parts = halves(truth, 0.05)
    broken = parts[0], Half(parts[1].mean.copy(), SPP)
    broken[1].mean[5, 7, 1] = np.nan
    blend, judged = blended(mean(broken), broken, blur, VIEW)
    assert np.isnan(blend.image[5, 7, 1])
    assert np.isfinite(blend.image).all(axis=-1).sum() == SIZE**2 - 1
    assert blend.weight[5, 7] == 0
    assert np.argwhere(judged.likely.non_finite).tolist() == [[5, 7]]
    whole, _ = blended(mean(parts), parts, blur, VIEW)
    np.testing.assert_allclose(blend.image[40:], whole.image[40:], rtol=1e-5)


def test_halves_have_the_size_of_the_image() -> None:
    one, other = halves(ramp(), 0.05)
    with pytest.raises(ValueError, match="differ in size"):
        blended(mean((one, other)), (one, Half(other.mean[1:], SPP)), blur, VIEW)


def test_a_rule_goes_on_while_the_samples_do_not_tell_how_wrong_the_denoiser_is() -> None:
    metric, rule = VisibleDifferences(VIEW), Visible(target=0.01, min_spp=1)

    def evidence(spp: int, sigma: float) -> Evidence:
        parts = halves(ramp(), sigma)
        blend, error = blended(mean(parts), parts, blur, VIEW)
        return Evidence(spp, blend.image, None, metric, error)

    # Given an image that has reached the target by its estimate, and may have twice as much left
    said = [rule.judge(evidence(spp, 0.01)) for spp in (64, 128)]
    assert all(one.value <= 0.01 for one in said)
    # Then the rule says so and goes on
    assert not said[-1].stop
    assert "is reached, but it is undetermined: 440 pixels may differ" in said[-1].reason
    # And forecasts when they will have told
    ahead = evidence(128, 0.01).forecast(0.01)
    assert 128 < ahead < 128 * 4
    # Until more samples have told
    assert rule.judge(evidence(256, 0.005)).stop
    assert evidence(256, 0.005).forecast(0.01) == 256
