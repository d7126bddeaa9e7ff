"""The blend of an image with its denoised self, by what each risks; and the blend's own error.

A denoiser takes noise away and brings bias, which more samples do not take away. Both can be
measured without a reference, since the samples form halves: one half's noise is not in the other.
So each pixel leans to whichever has the smaller error, and the blend converges as the image does.

The blend's error is measured in the same way, by quarters of the samples: a half is blended by its
own quarters, and compared with the other half, which had no say in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from plateau.metric.denoise import smoothed
from plateau.metric.display import Image, Plane, as_image, finite_pixels
from plateau.metric.noise_model import Half, NoiseModel

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from plateau.metric.display import Mask, View

#: A denoiser: it takes a finite (H, W, 3) float32 image of linear radiance and returns another, the
#: same one each time.
Denoise: TypeAlias = Callable[[Image], Image]

# Squared errors are pooled around each pixel by the pyramid's kernel, its taps so far apart.
_GAPS: Final = (1, 2)  #: for the weight: together σ = 2.1 pixels
_JUDGED_GAPS: Final = (1, 2, 2)  #: for the blend's error: σ = 2.8 pixels
_JUDGED_PIXELS: Final = 4 * math.pi * 2.8**2  #: that this pools
#: Standard errors by which the blend's error may be greater than it was measured.
_DOUBT: Final = 2.0
_HALF: Final = np.float32(0.5)
_LEAST: Final = np.float32(1e-30)  #: prevents 0/0


@dataclass(frozen=True, eq=False)
class Blend:
    """An image blended with its denoised self."""

    #: (H, W, 3) float32 linear radiance. Pixels that are NaN or infinite stay so.
    image: Image
    #: What the denoiser made of the image, (H, W, 3) float32.
    denoised: Image = field(repr=False)
    #: The share of the denoised image in each pixel, (H, W) float32 in [0, 1].
    weight: Plane = field(repr=False)

    def with_flaws(self, image: Image, flawed: Mask) -> Blend:
        """Return the blend with these pixels of the image, which no denoiser mends."""
        if not flawed.any():
            return self
        mixed = np.where(flawed[..., np.newaxis], as_image(image), self.image)
        return Blend(mixed, self.denoised, np.where(flawed, np.float32(0), self.weight))


@dataclass(frozen=True, eq=False)
class BlendError:
    """The error of a blend: its noise and its bias, as if both were noise."""

    #: The blend, and noise with the energy of its error around each pixel.
    likely: NoiseModel = field(repr=False)
    #: The same image with the greatest error that the samples leave possible.
    greatest: NoiseModel = field(repr=False)


def blended(image: Image, halves: tuple[Half, Half], denoise: Denoise, view: View) -> Blend:
    """Return the blend of an image with its denoised self.

    Parameters
    ----------
    image
        The merged image of both halves, (H, W, 3) linear radiance.
    halves
        Two halves of its samples.
    denoise
        The denoiser; it is asked three times.
    view
        The display on which errors count: light above its white does not.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Notes
    -----
    The weight of the denoised image d(I) is V / (V + M), both pooled around the pixel. V is the
    variance of the image I with halves A and B, |A − B|² n_A n_B / n². M is the mean squared error
    of a denoised half, ½|d(A) − B|² + ½|d(B) − A|² − ½|A − B|². It is unbiased, since d(A) has no
    sample of B.

    References
    ----------
    S. Zheng, F. Zheng, K. Xu and L.-Q. Yan, Ensemble denoising for Monte Carlo renderings, ACM
    Transactions on Graphics 40(6), 2021 (denoised images combined by their errors).
    doi:10.1145/3478513.3480510
    A. Firmino, J. R. Frisvad and H. W. Jensen, Progressive denoising of Monte Carlo rendered
    images, Computer Graphics Forum 41(2), 2022 (mixed with the noisy image, so that it converges).
    doi:10.1111/cgf.14454

    Examples
    --------
    >>> from plateau.metric import Half, View
    >>> light = np.full((32, 32, 3), 0.5, np.float32)
    >>> one, other = light + np.random.default_rng(1).normal(0, 0.1, (2, 32, 32, 3))
    >>> found = blended((one + other) / 2, (Half(one, 8), Half(other, 8)), lambda _: light, View())
    >>> bool(found.weight.mean() > 0.9)
    True
    """
    one, other = halves
    flawed, (shown, *means) = _without_flaws(image, one.mean, other.mean)
    noisy = _Halved(shown, means[0], means[1], one.spp / (one.spp + other.spp))
    return _blend(noisy, noisy.each(denoise), view).with_flaws(image, flawed)


def blended_and_judged(
    image: Image, quarters: Sequence[Half], denoise: Denoise, view: View
) -> tuple[Blend, BlendError]:
    """Return the blend, and its error.

    Parameters
    ----------
    image
        The merged image of all quarters, (H, W, 3) linear radiance.
    quarters
        Four quarters of its samples, of as many spp each. The first and the third form one half.
    denoise
        The denoiser; it is asked seven times.
    view
        The display on which errors count.

    Raises
    ------
    ValueError
        If the quarters and the image differ in size, or the quarters in their samples.

    Notes
    -----
    X(A) is half A blended by its own quarters. Its mean squared error is
    ½|X(A) − B|² + ½|X(B) − A|² − ½|A − B|², unbiased, and its variance ½|X(A) − X(B)|². The blend
    of all samples has half that variance and, at the most, the same bias. All are pooled. The noise
    of the model is ½(X(A) − X(B)), with its energy brought to that of the error.

    The standard error of the pooled error is that of a mean of independent pixels.
    """
    if len(quarters) != 4 or len({quarter.spp for quarter in quarters}) > 1:
        raise ValueError("a blend is judged by four quarters of as many samples each")
    flawed, found = _without_flaws(image, *(quarter.mean for quarter in quarters))
    shown, first, second, third, fourth = found
    halves = [
        _Halved((one + rest) * _HALF, one, rest) for one, rest in ((first, third), (second, fourth))
    ]
    clean = [half.each(denoise) for half in halves]
    noisy = _Halved(shown, halves[0].image, halves[1].image)
    blend = _blend(noisy, _Halved(denoise(shown), clean[0].image, clean[1].image), view)
    half_blends = [_blend(*pair, view).image for pair in zip(halves, clean, strict=True)]
    error = _error(blend, noisy, half_blends, view, flawed)
    return blend.with_flaws(image, flawed), error


@dataclass(frozen=True, eq=False)
class _Halved:
    """A finite image and its halves, (H, W, 3) each."""

    image: Image
    one: Image
    other: Image
    share: float = 0.5  #: of the samples in the first half

    def each(self, change: Denoise) -> _Halved:
        """Return the three images, changed."""
        return replace(
            self, image=change(self.image), one=change(self.one), other=change(self.other)
        )

    def as_shown(self, view: View) -> _Halved:
        """Return them as on a screen, where light above white is white."""
        return self.each(lambda image: np.clip(image, 0, np.float32(view.brightest)))


def _blend(noisy: _Halved, clean: _Halved, view: View) -> Blend:
    seen, smooth = noisy.as_shown(view), clean.as_shown(view)
    apart = _pooled(_energy(seen.one - seen.other), _GAPS)
    variance = apart * np.float32(noisy.share * (1 - noisy.share))
    crossed = _energy(smooth.one - seen.other) + _energy(smooth.other - seen.one)
    risk = np.maximum((_pooled(crossed, _GAPS) - apart) * _HALF, 0)
    weight = variance / np.maximum(variance + risk, _LEAST)
    share = weight[..., np.newaxis]
    return Blend(share * clean.image + (1 - share) * noisy.image, clean.image, weight)


def _error(
    blend: Blend, noisy: _Halved, half_blends: list[Image], view: View, flawed: Mask
) -> BlendError:
    whole = _Halved(blend.image, half_blends[0], half_blends[1]).as_shown(view)
    seen = noisy.as_shown(view)
    noise = (whole.one - whole.other) * _HALF
    own = _energy(noise)  # of the whole blend's variance
    # The mean squared error of a half's blend, less the half of its variance that the whole lacks.
    crossed = _energy(whole.one - seen.other) + _energy(whole.other - seen.one)
    errors = (crossed - _energy(seen.one - seen.other)) * _HALF - own
    measured, own = _pooled(errors, _JUDGED_GAPS), _pooled(own, _JUDGED_GAPS)
    spread = _pooled(np.square(errors), _JUDGED_GAPS) - np.square(measured)
    doubt = np.sqrt(np.maximum(spread, 0) / np.float32(_JUDGED_PIXELS))

    def model(error: Plane) -> NoiseModel:
        # There is variance at the least.
        gain = np.sqrt(np.maximum(error, own) / np.maximum(own, _LEAST))
        return NoiseModel(whole.image, gain[..., np.newaxis] * noise, flawed)

    return BlendError(model(measured), model(measured + np.float32(_DOUBT) * doubt))


def _without_flaws(*images: NDArray[Any]) -> tuple[Mask, list[Image]]:
    """Return where an image is NaN or infinite, and the images with 0 there."""
    found = [as_image(image) for image in images]
    if len({image.shape for image in found}) > 1:
        raise ValueError("the image and its parts differ in size")
    flawed = ~np.logical_and.reduce([finite_pixels(image) for image in found])
    if flawed.any():
        found = [np.where(flawed[..., np.newaxis], np.float32(0), image) for image in found]
    return flawed, found


def _energy(image: Image) -> Plane:
    energy: Plane = np.square(image).sum(axis=-1)
    return energy


def _pooled(plane: Plane, gaps: Iterable[int]) -> Plane:
    for gap in gaps:
        plane = smoothed(plane, gap)
    return plane
