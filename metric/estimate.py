"""How many pixels of an image a person would see differ from the converged one, without having it.

The slices are split in two halves with means A and B, and the merged image is I. Then I - A is made
of the same noise as I - truth, so D(A, I) stands for D(truth, I). With n_A = n_B even the variance
is the same; otherwise Var(I - A) = σ² n_B / (n n_A), where I - truth has σ²/n, and the residual is
scaled by sqrt(n_A / n_B) to match.

Known bias: it is optimistic. The halves' noise masks differences, which the truth's would not, and
rare bright samples sit in one half only. The band around it was measured on synthetic noise of
which the truth is known; docs/stopping.md has the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from metric.display import Image, Mask, Plane, as_image

if TYPE_CHECKING:
    from metric.vdp import Percept, VisibleDifferences

#: The band is meant to hold the truth in nine cases of ten.
BAND_COVERAGE = 0.9
#: Standard deviations on either side of a normal distribution that hold so much of it.
BAND_DEVIATIONS = 1.645
#: The most by which the truth was found to exceed the estimate where little is left to see, as a
#: multiple of the estimate: flat grey seen at 1920 pixels across. Near 0 where all is visible.
WORST_BIAS = 1.0
#: A clump of visible pixels counts as one event; larger ones have joined by chance.
LARGEST_CLUMP = 25.0


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


@dataclass(frozen=True)
class Estimate:
    """How far an image is from the converged one, as far as an eye can tell."""

    #: Visible pixels, 0 or more; a mean of two counts.
    pixels: float
    #: `pixels` over the number of pixels, in [0, 1].
    fraction: float
    #: The band around `pixels` that holds the true count in about nine cases of ten.
    low_pixels: float
    high_pixels: float
    #: How many of `pixels` are NaN or infinite; a mean of two counts. No sample will repair them.
    non_finite: float
    #: For each pixel the share of the two halves against which it is visible: 0, ½ or 1,
    #: (H, W) float32.
    visible: Plane = field(repr=False, compare=False)

    @property
    def low_fraction(self) -> float:
        """`low_pixels` over the number of pixels, in [0, 1]."""
        return self.low_pixels / self.visible.size

    @property
    def high_fraction(self) -> float:
        """`high_pixels` over the number of pixels, in [0, 1]."""
        return self.high_pixels / self.visible.size


def half_buffer_estimate(
    metric: VisibleDifferences,
    image: Image,
    halves: tuple[Half, Half],
    *,
    percept: Percept | None = None,
) -> Estimate:
    """Return the estimate of D(truth, image): the mean of D(A, image) and D(B, image).

    Parameters
    ----------
    metric
        The predictor, under the view in which to judge.
    image
        The merged image of both halves, (H, W, 3).
    halves
        A and B.
    percept
        The image's percept, where it is at hand.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Notes
    -----
    The band takes the count for one of independent clumps of pixels, whose number varies as a
    Poisson variable's does, in the estimate and in the truth alike; and it reaches up to twice the
    estimate where little is left to see, since that is how optimistic it was found to be at worst.

    Examples
    --------
    >>> from metric import View, VisibleDifferences
    >>> noise = np.random.default_rng(1).normal(0, 0.05, (2, 64, 64, 3)).astype(np.float32)
    >>> even, odd = np.float32(0.4) + noise
    >>> estimate = half_buffer_estimate(
    ...     VisibleDifferences(View()), (even + odd) / 2, (Half(even, 50), Half(odd, 50))
    ... )
    >>> estimate.low_pixels < estimate.pixels < estimate.high_pixels
    True
    """
    image = as_image(image)
    percept = percept or metric.percept(image)
    even, odd = halves
    differences = [
        metric.compare(metric.percept(stand_in_for_truth(image, half, other)), percept)
        for half, other in ((even, odd), (odd, even))
    ]
    pixels = sum(difference.count for difference in differences) / 2
    non_finite = sum(difference.non_finite for difference in differences) / 2
    visible = np.add(*(difference.visible for difference in differences), dtype=np.float32)
    visible *= np.float32(0.5)
    low, high = _band(pixels - non_finite, visible > 0)
    return Estimate(
        pixels,
        pixels / visible.size,
        low_pixels=low + non_finite,
        high_pixels=min(high + non_finite, float(visible.size)),
        non_finite=non_finite,
        visible=visible,
    )


def stand_in_for_truth(image: Image, half: Half, other: Half, shrink: float = 1.0) -> Image:
    """Return an image whose difference from `image` has the variance of the image's own error.

    Parameters
    ----------
    image
        The merged image, (H, W, 3).
    half
        The half that stands in.
    other
        The rest of the image.
    shrink
        What the difference is multiplied by, 0 or more: sqrt(n/n') for the error at n' spp.

    Raises
    ------
    ValueError
        If half and image differ in size.

    Examples
    --------
    >>> image = np.full((1, 1, 3), 0.5, np.float32)
    >>> half, rest = Half(image + np.float32(0.1), 20), Half(image, 80)
    >>> stand_in_for_truth(image, half, rest)[0, 0].round(3).tolist()
    [0.550000011920929, 0.550000011920929, 0.550000011920929]
    """
    mean = as_image(half.mean)
    if mean.shape != image.shape:
        raise ValueError(f"a half has shape {mean.shape}, the merged image {image.shape}")
    scale = shrink * math.sqrt(half.spp / other.spp)
    if scale == 1:
        return mean
    # A non-finite pixel of the merged image stays one: the metric counts it.
    with np.errstate(invalid="ignore"):
        scaled: Image = image + np.float32(scale) * (mean - image)
    return scaled


def allowed_pixels(target: float, pixels: int) -> float:
    """Return how many pixels a target fraction allows: at least one.

    No single pixel, a firefly's say, may hold up a whole image.

    Examples
    --------
    >>> allowed_pixels(0.001, 65_536), allowed_pixels(0.001, 64)
    (65.536, 1.0)
    """
    return max(1.0, target * pixels)


def require_target(target: float) -> None:
    """Raise ValueError unless a target fraction lies between 0 and 1."""
    if not 0 < target < 1:
        raise ValueError(f"target must lie between 0 and 1, not {target}")


def mean_clump(visible: Mask) -> float:
    """Return how many visible pixels come together, 1 or more: pixels over connected clumps.

    Clumps are counted by Euler's formula, corners less edges plus faces, with pixels as the
    corners; that is exact for clumps without holes.

    Examples
    --------
    >>> mask = np.zeros((8, 8), bool)
    >>> mask[1:3, 1:4] = mask[6, 6] = True
    >>> mean_clump(mask)
    3.5
    """
    rows = visible[1:] & visible[:-1]
    columns = visible[:, 1:] & visible[:, :-1]
    faces = rows[:, 1:] & rows[:, :-1]
    pixels, edges, squares = map(
        int,
        map(np.count_nonzero, (visible, np.concatenate([rows.ravel(), columns.ravel()]), faces)),
    )
    clumps = max(pixels - edges + squares, 1)
    return min(max(pixels / clumps, 1.0), LARGEST_CLUMP)


def _band(pixels: float, visible: Mask) -> tuple[float, float]:
    """Return between which counts the truth lies, most likely, given the estimate."""
    # The square root of a Poisson count varies by ½ whatever the count; both vary, by clumps.
    clump = mean_clump(visible)
    spread = BAND_DEVIATIONS * math.sqrt(2 * clump) / 2
    low = max(math.sqrt(pixels) - spread, 0.0) ** 2
    high = (math.sqrt(pixels + 0.375 * clump) + spread) ** 2
    hidden = max(1 - pixels / visible.size, 0.0)
    return low, high * (1 + WORST_BIAS * hidden * hidden)
