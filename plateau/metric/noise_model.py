"""The noise model of a merged image: the image without noise, and a sample of its noise.

The slices form two halves with means A and B; the merged image is I. Then A - I is noise of the
same kind as I - truth. With n_A = n_B the variances are equal. Otherwise
Var(A - I) = σ² n_B / (n n_A) and Var(I - truth) = σ²/n, so the sample is scaled by sqrt(n_A / n_B).
B gives the same sample with the other sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.display import Image, Mask, as_image, finite_pixels
from plateau.metric.rows import by_rows

if TYPE_CHECKING:
    from plateau.metric.display import View
    from plateau.metric.vdp import VisibleDifferences


@dataclass(frozen=True, eq=False)
class Half:
    """The mean of one half of the slices, those with an even or those with an odd index."""

    #: (H, W, 3) float32.
    mean: Image
    #: Samples per pixel in this half, 1 or more; their mean, where zones of the image have others.
    spp: float

    def __post_init__(self) -> None:
        if self.spp < 1:
            raise ValueError(f"a half must hold at least 1 spp, not {self.spp}")


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """An approximation of the converged image, and noise like the merged image's own."""

    #: The merged image without its noise, clipped to the screen's range, (H, W, 3) float32.
    clean: Image
    #: A sample of noise with the variance of the merged image's, (H, W, 3) float32.
    noise: Image
    #: Pixels of the merged image that are NaN or infinite, (H, W).
    non_finite: Mask = field(repr=False)

    @property
    def pixels(self) -> int:
        """The number of pixels."""
        return self.non_finite.size

    def rows(self, first: int, last: int) -> NoiseModel:
        """Return the model of the rows first … last − 1."""
        rows = slice(first, last)
        return NoiseModel(self.clean[rows], self.noise[rows], self.non_finite[rows])

    def noisy(self, amount: float) -> Image:
        """Return the clean image plus `amount` times the noise: ±1 is the present noise.

        Pixels of the merged image that are not finite are NaN.
        """
        image: Image = np.float32(amount) * self.noise
        image += self.clean
        if self._has_non_finite:
            image[self.non_finite] = np.nan
        return image

    def finite_noisy(self, amount: float) -> Image:
        """Return `noisy`, with the clean image's pixels where the merged image is not finite."""
        image = self.noisy(amount)
        if self._has_non_finite:
            image[self.non_finite] = self.clean[self.non_finite]
        return image

    @cached_property
    def _has_non_finite(self) -> bool:
        return bool(self.non_finite.any())


def noise_model(metric: VisibleDifferences, image: Image, halves: tuple[Half, Half]) -> NoiseModel:
    """Return the model of a merged image and its halves.

    Parameters
    ----------
    metric
        The predictor that will judge it. Its view shows some values as white; noise there is 0.
    image
        The merged image of both halves, (H, W, 3).
    halves
        The even- and the odd-indexed slices.

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
    even_spp, odd_spp = (half.spp for half in halves)
    scale = np.float32(math.sqrt(even_spp / odd_spp))
    clipped, noise = np.empty((2, *image.shape), np.float32)
    non_finite = np.empty(image.shape[:2], np.bool_)

    def split(first: int, last: int) -> None:
        rows = slice(first, last)
        shown, half = image[rows], even[rows]
        finite = finite_pixels(shown) & finite_pixels(half) & finite_pixels(odd[rows])
        if not finite.all():
            shown, half = (np.where(finite[..., np.newaxis], one, 0) for one in (shown, half))
        # Clipped as on the screen, so that noise above white does not spread to its surroundings.
        spread = scale * (half - shown)
        above, below = (_clipped(one, metric.view) for one in (shown + spread, shown - spread))
        noise[rows] = (above - below) * np.float32(0.5)
        clipped[rows] = _clipped(shown, metric.view)
        non_finite[rows] = ~finite

    by_rows(split, non_finite.shape)
    return NoiseModel(metric.denoised(clipped, noise), noise, non_finite)


def _clipped(image: Image, view: View) -> Image:
    clipped: Image = np.clip(image, 0, np.float32(view.brightest))
    return clipped
