"""How many pixels of an image a person would see differ from the converged one, without having it.

The image without its noise, T, stands for the truth, and noise like the image's own, N, for its
error (see `plateau.metric.noise_model`). Then D(T, T + N) and D(T, T - N) stand for D(truth,
image).

It takes the clean image and not the merged one, since noise masks noise: from the merged image and
one half of it the same number came out at 0.5 to 0.9 of the truth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.noise_model import Half, NoiseModel, noise_model

if TYPE_CHECKING:
    from plateau.metric.display import Image, Mask, Plane
    from plateau.metric.vdp import Percept, VisibleDifferences

#: Standard deviations on either side of a normal distribution that hold nine tenths of it.
BAND_DEVIATIONS = 1.645
#: By how much the estimate was found off on synthetic noise where luck hardly matters, as a share.
MODEL_ERROR = 0.1
#: A clump of visible pixels counts as one event; larger ones have joined by chance.
LARGEST_CLUMP = 25.0


@dataclass(frozen=True)
class Estimate:
    """How far an image is from the converged one, as far as an eye can tell."""

    #: Visible pixels, 0 or more; a mean of two counts. Pixels that are NaN or infinite are left out
    #: here and below: no sample will repair them.
    pixels: float
    #: `pixels` over the number of pixels, in [0, 1].
    fraction: float
    #: The band around `pixels` that holds the true count in about nine cases of ten.
    low_pixels: float
    high_pixels: float
    #: How many pixels are NaN or infinite.
    non_finite: int
    #: For each pixel the share of the two comparisons in which it is visible: 0, ½ or 1,
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
) -> Estimate:
    """Return the estimate of D(truth, image): the mean of D(T, T + N) and D(T, T - N).

    Parameters
    ----------
    metric
        The predictor, under the view in which to judge.
    image
        The merged image of both halves, (H, W, 3).
    halves
        A and B.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.

    Notes
    -----
    The band takes the count for one of independent clumps of pixels, whose number varies as a
    Poisson variable's does, in the estimate and in the truth alike.

    Examples
    --------
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> noise = np.random.default_rng(1).normal(0, 0.05, (2, 64, 64, 3)).astype(np.float32)
    >>> even, odd = np.float32(0.4) + noise
    >>> estimate = half_buffer_estimate(
    ...     VisibleDifferences(View()), (even + odd) / 2, (Half(even, 50), Half(odd, 50))
    ... )
    >>> estimate.low_pixels < estimate.pixels < estimate.high_pixels
    True
    """
    model = noise_model(metric, image, halves)
    return estimate_from(metric, model, metric.percept(model.clean))


def estimate_from(metric: VisibleDifferences, model: NoiseModel, clean: Percept) -> Estimate:
    """Return the estimate, where the model and the percept of its clean image are at hand."""
    differences = [
        metric.compare(clean, metric.percept(model.noisy(amount))) for amount in (1.0, -1.0)
    ]
    pixels = sum(difference.finite_count for difference in differences) / 2
    visible = np.add(*(difference.visible for difference in differences), dtype=np.float32)
    visible *= np.float32(0.5)
    non_finite = differences[0].non_finite
    if non_finite:
        visible[model.non_finite] = 0
    low, high = _band(pixels, visible > 0)
    return Estimate(
        pixels,
        pixels / visible.size,
        low_pixels=low,
        high_pixels=min(high, float(visible.size - non_finite)),
        non_finite=non_finite,
        visible=visible,
    )


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
    return low * (1 - MODEL_ERROR), high * (1 + MODEL_ERROR)
