"""The blend of an image with its denoised self, on images whose truth is known."""

from collections.abc import Callable

import numpy as np
import pytest

from plateau.metric import (
    Half,
    Image,
    View,
    VisibleDifferences,
    blended,
    blended_and_judged,
    estimate_from,
)
from plateau.metric.denoise import smoothed

VIEW = View(field_of_view_deg=20)
SIZE = 128
SPP = 16  # of a quarter


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


def quarters(truth: Image, sigma: float, seed: int = 1) -> list[Half]:
    rng = np.random.default_rng(seed)
    return [
        Half(truth + rng.normal(0, sigma, truth.shape).astype(np.float32), SPP) for _ in range(4)
    ]


def mean(parts: list[Half]) -> Image:
    return np.mean([part.mean for part in parts], axis=0)


def error(image: Image, truth: Image) -> float:
    return float(np.square(image - truth).mean())


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_it_is_hardly_worse_than_the_better_of_the_two(truth: Image, sigma: float) -> None:
    parts = quarters(truth, sigma)
    image = mean(parts)
    blend, _ = blended_and_judged(image, parts, blur, VIEW)
    better = min(error(image, truth), error(blur(image), truth))
    # The errors are measured, so a little noise stays where there need be none
    assert error(blend.image, truth) < 1.15 * better + 0.03 * error(image, truth)


def test_a_denoiser_that_is_wrong_loses_its_weight_as_samples_come() -> None:
    truth = TRUTHS["texture finer than the blur"]()
    weights = [
        blended_and_judged(mean(parts), parts, blur, VIEW)[0].weight.mean()
        for parts in (quarters(truth, sigma) for sigma in (0.2, 0.05, 0.01))
    ]
    assert weights == sorted(weights, reverse=True)
    assert weights[-1] < 0.01


@pytest.mark.parametrize("truth", [one() for one in TRUTHS.values()], ids=TRUTHS)
@pytest.mark.parametrize("denoise", [blur, nothing])
def test_its_error_is_known_without_the_truth(truth: Image, denoise: Callable) -> None:
    found, meant, noise = 0.0, 0.0, 0.0
    for seed in range(4):
        parts = quarters(truth, 0.1, seed)
        blend, judged = blended_and_judged(mean(parts), parts, denoise, VIEW)
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
        parts = quarters(truth, 0.1, seed)
        blend, judged = blended_and_judged(mean(parts), parts, blur, VIEW)
        clean = metric.percept(judged.likely.clean)
        estimated += estimate_from(metric, judged.likely, clean).pixels
        most += estimate_from(metric, judged.greatest, clean).pixels
        seen += metric.compare(light, metric.percept(blend.image)).finite_count
        before += metric.compare(light, metric.percept(mean(parts))).finite_count
    assert 0.8 * seen < estimated < 1.25 * seen + 0.2 * before
    assert most >= max(estimated, seen)


def test_halves_of_other_sizes_do() -> None:
    truth = ramp()
    parts = quarters(truth, 0.1)
    one, other = parts[0], Half(mean(parts[1:]), 3 * SPP)
    image = mean(parts)
    blend = blended(image, (one, other), blur, VIEW)
    assert error(blend.image, truth) < 0.2 * error(image, truth)
    assert 0 <= blend.weight.min() <= blend.weight.max() <= 1


def test_pixels_that_no_denoiser_mends_stay_and_hurt_no_others() -> None:
    truth = TRUTHS["flat"]()
    parts = quarters(truth, 0.1)
    broken = [Half(part.mean.copy(), SPP) for part in parts]
    broken[2].mean[5, 7, 1] = np.nan
    blend, judged = blended_and_judged(mean(broken), broken, blur, VIEW)
    assert np.isnan(blend.image[5, 7, 1])
    assert np.isfinite(blend.image).all(axis=-1).sum() == SIZE**2 - 1
    assert blend.weight[5, 7] == 0
    assert np.argwhere(judged.likely.non_finite).tolist() == [[5, 7]]
    whole, _ = blended_and_judged(mean(parts), parts, blur, VIEW)
    np.testing.assert_allclose(blend.image[40:], whole.image[40:], rtol=1e-5)


def test_quarters_have_as_many_samples_each() -> None:
    parts = quarters(ramp(), 0.1)
    with pytest.raises(ValueError, match="four quarters of as many samples"):
        blended_and_judged(mean(parts), [*parts[:3], Half(parts[3].mean, 99)], blur, VIEW)
    with pytest.raises(ValueError, match="four quarters"):
        blended_and_judged(mean(parts), parts[:2], blur, VIEW)
    with pytest.raises(ValueError, match="differ in size"):
        blended(mean(parts), (parts[0], Half(parts[1].mean[1:], SPP)), blur, VIEW)
