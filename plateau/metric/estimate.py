"""The half-buffer estimate: how many pixels differ visibly from the converged image.

The converged image is unknown. T, the image without its noise, takes its place, and N, noise like
the image's own, that of the error (see `plateau.metric.noise_model`). Then D(T, T + N) and
D(T, T - N) estimate D(truth, image).

T is the clean image, not the merged one, because noise masks noise: an estimate from the merged
image and one of its halves was 0.5 to 0.9 of the truth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.noise_model import NoiseModel

if TYPE_CHECKING:
    from plateau.metric.display import Mask, Plane
    from plateau.metric.vdp import Percept, VisibleDifferences

#: A normal distribution has nine tenths of its mass within this many standard deviations.
BAND_DEVIATIONS = 1.645
#: Relative error of the estimate on synthetic noise, measured where chance hardly matters.
MODEL_ERROR = 0.1
#: The most pixels of a clump that counts as one event; larger clumps have joined by chance.
LARGEST_CLUMP = 25.0
#: How many times as much may be wrong, as far as the samples tell, where an estimate is determined.
DETERMINED = 2.0


@dataclass(frozen=True)
class Estimate:
    """The visible difference of an image from the converged one, as estimated."""

    #: Visible pixels, 0 or more; a mean of two counts. This and
    #: the fields below leave out pixels that are NaN or infinite, which no sample repairs.
    pixels: float
    #: `pixels` over the number of pixels, in [0, 1].
    fraction: float
    #: The band around `pixels` that holds the true count in about nine cases of ten.
    low_pixels: float
    high_pixels: float
    #: How many pixels are NaN or infinite.
    non_finite: int
    #: The share of both comparisons in which a pixel is visible: 0, ½ or 1, (H, W) float32.
    visible: Plane = field(repr=False, compare=False)
    #: Visible pixels at the greatest error that the samples leave possible; None where the error is
    #: noise alone, which halves show.
    greatest_pixels: float | None = None

    def is_determined(self, allowed: float) -> bool:
        """Return whether the samples tell the error, given how many pixels may be wrong.

        Notes
        -----
        The greatest error makes at most `DETERMINED` times as many pixels visible as the likely
        one, or as are allowed.
        """
        most = DETERMINED * max(self.pixels, allowed)
        return self.greatest_pixels is None or self.greatest_pixels <= most


def estimate_from(metric: VisibleDifferences, model: NoiseModel, clean: Percept) -> Estimate:
    """Return the estimate from a noise model and the percept of its clean image.

    It is of D(truth, image): the mean of D(T, T + N) and D(T, T - N). The band assumes independent
    clumps of pixels, whose number is a Poisson variable, both in the estimate and in the truth.
    """
    differences = [
        metric.compare(clean, metric.percept(model.noisy(amount))) for amount in (1.0, -1.0)
    ]
    pixels = sum(one.finite_count for one in differences) / 2
    visible = np.add(*(difference.visible for difference in differences), dtype=np.float32)
    visible *= np.float32(0.5)
    non_finite = differences[0].non_finite
    if non_finite:
        visible[model.non_finite] = 0
    low, high = _band(pixels, mean_clump(visible > 0))
    return Estimate(
        pixels,
        pixels / visible.size,
        low_pixels=low,
        high_pixels=min(high, float(visible.size - non_finite)),
        non_finite=non_finite,
        visible=visible,
    )


def require_target(target: float) -> None:
    """Raise ValueError unless a target fraction lies between 0 and 1."""
    if not 0 < target < 1:
        raise ValueError(f"target must lie between 0 and 1, not {target}")


def mean_clump(visible: Mask) -> float:
    """Return the mean size of a connected clump of visible pixels, 1 or more.

    Euler's formula counts the clumps: corners less edges plus faces, with pixels as the corners. It
    is exact for clumps without holes.

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
    pixels = int(np.count_nonzero(visible))
    edges = int(np.count_nonzero(rows)) + int(np.count_nonzero(columns))
    clumps = max(pixels - edges + int(np.count_nonzero(faces)), 1)
    return min(max(pixels / clumps, 1.0), LARGEST_CLUMP)


def _band(pixels: float, clump: float) -> tuple[float, float]:
    """Return the least and the greatest likely count of the truth, given the estimate."""
    # The square root of a Poisson count has deviation ½. Estimate and truth both vary, by clumps.
    spread = BAND_DEVIATIONS * math.sqrt(2 * clump) / 2
    low = max(math.sqrt(pixels) - spread, 0.0) ** 2
    high = (math.sqrt(pixels + 0.375 * clump) + spread) ** 2
    return low * (1 - MODEL_ERROR), high * (1 + MODEL_ERROR)
