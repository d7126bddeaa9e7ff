"""The blend of an image with its denoised self, by what each risks; and the blend's own error.

A denoiser takes noise away and brings bias, which more samples do not take away. Both can be
measured without a reference, since the samples form halves: one half's noise is not in the other.
So each pixel leans to whichever has the smaller error, and the blend converges as the image does.

The blend's error is measured in the same way: each half is blended with its denoised self, and
compared with the other half at pixels that had no say in it.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np

from plateau.metric.denoise import smoothed
from plateau.metric.display import Image, Mask, Plane, View, as_image
from plateau.metric.halved import Change, Halved, Viewing, energy, halved
from plateau.metric.noise_model import Half, NoiseModel

#: A denoiser.
Denoise: TypeAlias = Change

# Squared errors are pooled around each pixel by the pyramid's kernel, its taps so far apart.
_GAPS: Final = (1, 2)  #: for the weight: together σ = 2.1 pixels
_NEAR: Final = (1, 2, 2)  #: for the blend's error: σ = 2.8 pixels
_WIDE: Final = (1, 2, 4, 4)  #: for what surrounds it: σ = 5.8 pixels
#: The kernel of `_GAPS` within two pixels: its centre, and the next taps.
_CENTRE: Final = (0.185, 0.1625, 0.1225)
_REST: Final = 1 - (_CENTRE[0] + 2 * _CENTRE[1] + 2 * _CENTRE[2]) ** 2  #: of its sum, outside
#: Standard errors by which an error differs from its surroundings', or may be greater than it was
#: measured, before that counts.
_DOUBT: Final = 2.0
_VARIANCE: Final = 0.9  #: of the pyramid's kernel, in squared pixels
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
    #: The blend as it is seen, (H, W, 3) float32: the image itself, where nobody says otherwise.
    seen: Image = field(repr=False)

    def with_flaws(self, image: Image, flawed: Mask, see: Change) -> "Blend":
        """Return the blend with these pixels of the image, which no denoiser mends."""
        if not flawed.any():
            return self
        mixed = np.where(flawed[..., np.newaxis], as_image(image), self.image)
        weight = np.where(flawed, np.float32(0), self.weight)
        return Blend(mixed, self.denoised, weight, see(mixed))


@dataclass(frozen=True, eq=False)
class BlendError:
    """The error of a blend: its noise and its bias, as if both were noise."""

    #: The blend, and noise with the energy of its error around each pixel.
    likely: NoiseModel = field(repr=False)
    #: The same image with the greatest error that the samples leave possible.
    greatest: NoiseModel = field(repr=False)


def blended(
    image: Image,
    halves: tuple[Half, Half],
    denoise: Denoise,
    view: View,
    *,
    see: Change = np.asarray,
) -> tuple[Blend, BlendError]:
    """Return the blend of an image with its denoised self, and its error.

    Parameters
    ----------
    image
        The merged image of both halves, (H, W, 3) linear radiance.
    halves
        Two halves of its samples, of which neither has noise of the other.
    denoise
        The denoiser; it is asked three times.
    view
        The display on which errors count: light above its white does not.
    see
        Returns the light that the display makes of an image, where errors count: a scene's view
        transform, for one that has such. The denoiser and the blend have the image as rendered.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Notes
    -----
    The weight of the denoised image d(I) is V / (V + M), both pooled around the pixel. V is the
    variance of the image I with halves A and B, |A − B|² n_A n_B / n². M is the mean squared error
    of a denoised half, ½|d(A) − B|² + ½|d(B) − A|² − ½|A − B|². It is unbiased: d(A) has none of B.

    X(A) is half A blended with d(A), whose error is measured by B around the pixel, and not within
    two pixels of it: filters reach no farther, so that X(A) and B have independent noise there. Its
    mean squared error is ½|X(A) − B|² + ½|X(B) − A|² − ½|A − B|², unbiased, and |X(A) − X(B)|² is
    the sum of both variances, of which the blend of all samples has n_A n_B / n². At the most it
    has the same bias. The noise of the model is X(A) − X(B), with the energy of the error.

    The error is pooled near the pixel, and counts as far as it differs from its wider surroundings'
    by more than chance explains: with the difference δ and its standard error s, the gain is
    δ² / (δ² + 4s²). The greatest error has two standard errors of the surroundings' more. Standard
    errors are those of a mean of independent pixels.

    References
    ----------
    S. Zheng, F. Zheng, K. Xu and L.-Q. Yan, Ensemble denoising for Monte Carlo renderings, ACM
    Transactions on Graphics 40(6), 2021 (denoised images combined by their errors).
    doi:10.1145/3478513.3480510
    A. Firmino, J. R. Frisvad and H. W. Jensen, Progressive denoising of Monte Carlo rendered
    images, Computer Graphics Forum 41(2), 2022 (mixed with the noisy image, so that it converges).
    doi:10.1111/cgf.14454
    J.-S. Lee, Digital image enhancement and noise filtering by use of local statistics, IEEE
    Transactions on Pattern Analysis and Machine Intelligence 2(2), 1980 (a local value counts as
    far as it exceeds its noise). doi:10.1109/TPAMI.1980.4766994

    Examples
    --------
    >>> from plateau.metric import Half, View
    >>> light = np.full((32, 32, 3), 0.5, np.float32)
    >>> one, other = light + np.random.default_rng(1).normal(0, 0.1, (2, 32, 32, 3))
    >>> halves = Half(one, 8), Half(other, 8)
    >>> found, _ = blended((one + other) / 2, halves, lambda _: light, View())
    >>> bool(found.weight.mean() > 0.9)
    True
    """
    noisy, flawed = halved(image, halves, Viewing(view, see))
    clean = replace(
        noisy,
        image=denoise(noisy.image),
        one=denoise(noisy.one),
        other=denoise(noisy.other),
    )
    blend = _blend(noisy, clean)
    return blend.with_flaws(image, flawed, see), _error(blend, noisy, clean, flawed)


def blend_error(
    blend: Blend,
    image: Image,
    halves: tuple[Half, Half],
    denoise: Denoise,
    view: View,
    *,
    see: Change = np.asarray,
) -> BlendError:
    """Return the error of a blend by other halves of its samples than those that made it.

    Parameters
    ----------
    blend
        As `blended` returned it, of this image.
    image, halves, denoise, view, see
        As for `blended`; the denoiser is asked twice.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Notes
    -----
    The noise of two splits into halves is uncorrelated: who decides by one where samples go, and by
    the other whether they are enough, does not take chance for need. The bias is the same in both.

    Examples
    --------
    >>> from plateau.metric import Half, View
    >>> light = np.full((32, 32, 3), 0.5, np.float32)
    >>> a, b, c, d = light + np.random.default_rng(1).normal(0, 0.1, (4, 32, 32, 3))
    >>> image, own = (a + b + c + d) / 4, (Half((a + c) / 2, 8), Half((b + d) / 2, 8))
    >>> blend, error = blended(image, own, lambda _: light, View())
    >>> others = Half((a + b) / 2, 8), Half((c + d) / 2, 8)
    >>> found = blend_error(blend, image, others, lambda _: light, View())
    >>> bool(np.array_equal(found.likely.clean, error.likely.clean))
    True
    """
    noisy, flawed = halved(image, halves, Viewing(view, see))
    clean = replace(noisy, one=denoise(noisy.one), other=denoise(noisy.other))
    if flawed.any():
        whole = np.where(flawed[..., np.newaxis], np.float32(0), blend.image)
        blend = replace(blend, image=whole)
    return _error(blend, noisy, clean, flawed)


def _blend(noisy: Halved, clean: Halved) -> Blend:
    apart = _pooled(noisy.apart, _GAPS)
    crossed = _pooled(noisy.crossed(clean), _GAPS)
    weight = _weight(apart * np.float32(noisy.both), (crossed - apart) * _HALF)
    mixed = _mixed(noisy.image, clean.image, weight)
    return Blend(mixed, clean.image, weight, noisy.screen.see(mixed))


def _half_blends(noisy: Halved, clean: Halved) -> tuple[Image, Image]:
    """Return each half's blend, which at no pixel has noise of the other half there."""
    apart = _around(noisy.apart)

    def half(noisy: Image, clean: Image, shown: Image, other: Image, share: float) -> Image:
        risk = _around(energy(shown - other)) - np.float32(share) * apart
        return _mixed(noisy, clean, _weight(np.float32(1 - share) * apart, risk))

    return (
        half(noisy.one, clean.one, clean.shown[0], noisy.shown[1], noisy.share),
        half(noisy.other, clean.other, clean.shown[1], noisy.shown[0], 1 - noisy.share),
    )


def _weight(variance: Plane, risk: Plane) -> Plane:
    weight: Plane = np.divide(variance, np.maximum(variance + np.maximum(risk, 0), _LEAST))
    return weight


def _mixed(noisy: Image, clean: Image, weight: Plane) -> Image:
    share = weight[..., np.newaxis]
    mixed: Image = share * clean + (1 - share) * noisy
    return mixed


def _error(blend: Blend, noisy: Halved, clean: Halved, flawed: Mask) -> BlendError:
    one, other = _half_blends(noisy, clean)
    halves = replace(noisy, image=blend.image, one=one, other=other)
    noise = (halves.shown[0] - halves.shown[1]) * np.float32(math.sqrt(noisy.both))
    own = energy(noise)  # of the whole blend's variance
    # The mean squared error of a half's blend, less the variance that the whole lacks.
    errors = (noisy.crossed(halves) - noisy.apart) * _HALF
    errors -= own * np.float32(0.5 / noisy.both - 1)
    near, near_doubt = _measured(errors, _NEAR)
    wide, wide_doubt = _measured(errors, _WIDE)
    apart = np.square(near - wide)
    gain = apart / np.maximum(apart + np.square(np.float32(_DOUBT) * near_doubt), _LEAST)
    likely = wide + gain * (near - wide)
    own = _pooled(own, _NEAR)

    image = noisy.screen.shown(blend.image)

    def model(error: Plane) -> NoiseModel:
        # There is variance at the least.
        gain = np.sqrt(np.maximum(error, own) / np.maximum(own, _LEAST))
        return NoiseModel(image, gain[..., np.newaxis] * noise, flawed)

    return BlendError(model(likely), model(likely + np.float32(_DOUBT) * wide_doubt))


def _measured(errors: Plane, gaps: tuple[int, ...]) -> tuple[Plane, Plane]:
    """Return the errors pooled around each pixel, and the standard error of that."""
    mean = _pooled(errors, gaps)
    spread = np.maximum(_pooled(np.square(errors), gaps) - np.square(mean), 0)
    pixels = 4 * math.pi * _VARIANCE * sum(gap**2 for gap in gaps)
    doubt: Plane = np.sqrt(spread / np.float32(pixels))
    return mean, doubt


def _pooled(plane: Plane, gaps: Iterable[int]) -> Plane:
    for gap in gaps:
        plane = smoothed(plane, gap)
    return plane


def _around(plane: Plane) -> Plane:
    """Return the plane pooled around each pixel, without those within two pixels of it."""
    rest = _pooled(plane, _GAPS) - smoothed(plane, 1, _CENTRE)
    pooled: Plane = np.maximum(rest, 0) / np.float32(_REST)
    return pooled
