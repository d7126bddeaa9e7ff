"""A merged image taken apart into what it would be without noise, and a sample of its noise.

The slices are split in two halves with means A and B, and the merged image is I. Then A - I is
noise of the same kind as I - truth. With n_A = n_B even the variance is the same; otherwise
Var(A - I) = σ² n_B / (n n_A), where I - truth has σ²/n, and scaling by sqrt(n_A / n_B) makes up for
it. For B that gives the same sample with the other sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.display import Image, Mask, as_image, finite_pixels

if TYPE_CHECKING:
    from plateau.metric.display import View
    from plateau.metric.vdp import VisibleDifferences


@dataclass(frozen=True, eq=False)
class Half:
    """The mean of one half of the slices, those with an even or those with an odd index."""

    #: (H, W, 3) float32.
    mean: Image
    #: Samples per pixel in this half, 1 or more.
    spp: int

    def __post_init__(self) -> None:
        if self.spp < 1:
            raise ValueError(f"a half must hold at least 1 spp, not {self.spp}")


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """The converged image as far as it can be told, and noise like the merged image's own."""

    #: The merged image without its noise, (H, W, 3) float32, as far as a screen shows it.
    clean: Image
    #: A sample of noise with the variance of the merged image's, (H, W, 3) float32.
    noise: Image
    #: Pixels of the merged image that are NaN or infinite, (H, W).
    non_finite: Mask = field(repr=False)

    @property
    def pixels(self) -> int:
        """How many pixels there are."""
        return self.non_finite.size

    def noisy(self, amount: float) -> Image:
        """Return the clean image with `amount` times the noise: ±1 for as much as there is now.

        Pixels of the merged image that are not finite are NaN.
        """
        image: Image = np.float32(amount) * self.noise
        image += self.clean
        if self._has_non_finite:
            image[self.non_finite] = np.nan
        return image

    @cached_property
    def _has_non_finite(self) -> bool:
        return bool(self.non_finite.any())


def noise_model(metric: VisibleDifferences, image: Image, halves: tuple[Half, Half]) -> NoiseModel:
    """Return the model of a merged image and its halves.

    Parameters
    ----------
    metric
        The predictor that will judge it: noise in what its view shows as plain white is none.
    image
        The merged image of both halves, (H, W, 3).
    halves
        A and B.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Examples
    --------
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> image = np.full((1, 1, 3), 0.5, np.float32)
    >>> half, rest = Half(image + np.float32(0.1), 20), Half(image - np.float32(0.025), 80)
    >>> noise_model(VisibleDifferences(View()), image, (half, rest)).noise[0, 0].round(3).tolist()
    [0.05000000074505806, 0.05000000074505806, 0.05000000074505806]
    """
    image = as_image(image)
    even, odd = (as_image(half.mean) for half in halves)
    for mean in (even, odd):
        if mean.shape != image.shape:
            raise ValueError(f"a half has shape {mean.shape}, the merged image {image.shape}")
    finite = finite_pixels(image) & finite_pixels(even) & finite_pixels(odd)
    shown, half = image, even
    if not finite.all():
        shown, half = (np.where(finite[..., np.newaxis], pixels, 0) for pixels in (image, even))
    # Clipped as it will be shown, so that what is too bright to see makes no noise around it.
    even_spp, odd_spp = (half.spp for half in halves)
    spread = np.float32(math.sqrt(even_spp / odd_spp)) * (half - shown)
    above, below = (_clipped(one, metric.view) for one in (shown + spread, shown - spread))
    noise = (above - below) * np.float32(0.5)
    clean = metric.denoised(_clipped(shown, metric.view), noise)
    return NoiseModel(clean, noise, ~finite)


def _clipped(image: Image, view: View) -> Image:
    clipped: Image = np.clip(image, 0, np.float32(view.brightest))
    return clipped
