"""The error of a merged image against the converged one, known without it.

The slices form four quarters, whose means are the truth plus independent errors. Half the squared
difference of two quarters, scaled to all samples, is the squared error of the merged image without
bias: what remains of it against the truth is products of errors of different quarters. Products of
differences without a common quarter are of that kind, and say how far off the estimate may be. Few
bright samples cancel in it, since they are in the image as well.

The differences within the even and within the odd slices judge (two of the three contrasts of four
quarters), and the contrast of even and odd slices decides. So no estimate is reported because it
was low by chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from plateau.metric.zone_noise import zone_sums

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.display import Image, Plane

#: Given the means of the quarters, (3, H, W) each, and their slices: what returns, for the squared
#: difference of two of them, what it counts, by the numbers of the other two.
Weight: TypeAlias = Callable[[list[Any], Sequence[int]], Callable[[int, int], Any]]

#: Keeps the relative error of black pixels finite.
EPSILON = 0.01
#: What the mean squared error of a displayed image may be off by, as measured.
DISPLAY_ERROR = 0.01
#: The share of the pixels, one at least, of which is said what they hold of the error.
FEW = 1e-4
#: Sides in pixels: a pixel's noise is that of its tile; noise of two blocks is independent.
TILE, BLOCK = 8, 16
_BAND = 8 * BLOCK  # rows at a time
_MOST_FREEDOM = 1e9  # where there is no noise
_NORMAL = 1.96  # deviations that hold 95 % of a normal distribution


@dataclass(frozen=True, eq=False)
class Quarters:
    """The images of the slices 0, 4, 8, …, of those after each of them, and so on."""

    #: (H, W, 3) float32 linear radiance, as rendered.
    means: Sequence[Image]
    #: How many slices each has, 1 or more.
    slices: Sequence[int]
    #: The linear light of the display of such an image: that of a scene's view transform.
    see: Callable[[Image], Image]


@dataclass(frozen=True, eq=False)
class SquaredError:
    """The weighted mean over pixels and channels of (image - truth)², as estimated."""

    mean: float
    #: The interval that holds the truth in 95 of 100 cases.
    low: float
    high: float
    #: It is at most this in 97.5 of 100 cases, by the samples that decide.
    sure: float
    #: As many independent normal errors of one size would be as uncertain.
    freedom: float
    #: What `FEW` of the pixels hold of it, in [0, 1].
    few_share: float
    non_finite: int
    #: The same mean for each tile, by the samples that judge and by those that decide.
    tiles: tuple[NDArray[np.float64], ...] = field(repr=False)

    def at_share(self, share: float) -> tuple[float, ...]:
        """Return the mean of a tile that this share of them has at most, as the fields are.

        The interval is that of an order statistic: what share of the tiles has more is uncertain.
        """
        judged, decided = self.tiles
        spread = _NORMAL * math.sqrt(share * (1 - share) / judged.size)
        low, high = max(share - spread, 0.0), min(share + spread, 1.0)
        places = np.quantile(judged, [share, low, high])
        return *map(float, places), float(np.quantile(decided, high))


def squared_error(
    quarters: Quarters, weight: Weight, model_error: Callable[[float], float] = lambda _: 0.0
) -> SquaredError:
    """Return the squared error of the merged image of four quarters.

    Parameters
    ----------
    quarters
        The quarters. A pixel that is not finite in one of them is left out.
    weight
        What a squared error counts: `plain`, `relative` or `on_display`.
    model_error
        From the estimate to what it may be off by for the weights' sake, as a share of it.

    Notes
    -----
    With f degrees of freedom the truth over the estimate is about F(f, 2f), and over that of the
    deciding samples F(f, f); f is the square of the mean over Σ cov², summed over all pairs of
    pixels and channels within blocks. Where hits are so rare that no block has two of them in
    different quarters, Σ cov² is at least that of light that falls anywhere in its block. With b
    blocks that matter, normal deviations are those of Student's t with 2b degrees of freedom.

    References
    ----------
    F. E. Satterthwaite, An approximate distribution of estimates of variance components, Biometrics
    2(6), 1946. G. J. Székely and M. L. Rizzo, Partial distance correlation with methods for
    dissimilarities, Annals of Statistics 42(6), 2014: products without a common element.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(0, 0.2, (4, 64, 64, 3)).astype(np.float32)
    >>> found = squared_error(Quarters(0.5 + noise, [25] * 4, see=lambda image: image), plain)
    >>> bool(found.low < np.square(noise.mean(axis=0)).mean() < found.high)
    True
    """
    rows = range(0, len(quarters.means[0]), _BAND)
    bands = (
        _band([mean[top : top + _BAND] for mean in quarters.means], quarters.slices, weight)
        for top in rows
    )
    finite, judged, decided, *crossed = map(np.concatenate, zip(*bands, strict=True))
    pixels = int(np.count_nonzero(finite))
    held, other = (float(one.sum(dtype=np.float64)) for one in (judged, decided))
    few = max(1, math.ceil(FEW * judged.size))
    most = float(np.partition(judged, -few, axis=None)[-few:].sum(dtype=np.float64))
    mean, other = (max(one, 0.0) / (3 * pixels or 1) for one in (held, other))
    both = (2 * mean + other) / 3 * (3 * pixels)

    squares = np.mean([np.square(zone_sums(one, BLOCK)) for one in crossed], axis=0)
    anywhere = np.square(zone_sums(judged, BLOCK)) / (3 * np.maximum(zone_sums(finite, BLOCK), 1))
    squares = max(squares, anywhere, key=np.sum)
    summed = float(squares.sum())
    blocks = summed**2 / float(np.square(squares).sum()) if summed else math.inf
    uncertain = summed + (both * model_error(mean)) ** 2 / 3
    freedom = min(max(both**2 / uncertain, 1.0), _MOST_FREEDOM) if uncertain else _MOST_FREEDOM
    z = _NORMAL + 1.2 / blocks
    low, high = (mean * ratio_quantile(one, freedom, 2 * freedom) for one in (-z, z))
    counts = 3 * np.maximum(zone_sums(finite, TILE), 1)
    return SquaredError(
        mean=mean,
        low=low,
        high=high,
        sure=other * ratio_quantile(z, freedom, freedom),
        freedom=freedom,
        few_share=most / held if held > 0 else 0.0,
        non_finite=finite.size - pixels,
        tiles=tuple(np.maximum(zone_sums(one, TILE), 0) / counts for one in (judged, decided)),
    )


def _band(
    means: Sequence[Image], slices: Sequence[int], weight: Weight
) -> tuple[NDArray[Any], ...]:
    """Return where all are finite, the squared errors and the products of differences, (H, W)."""
    planes = [np.moveaxis(mean, -1, 0).astype(np.float32, order="C") for mean in means]
    finite = np.logical_and.reduce([np.isfinite(plane).all(axis=0) for plane in planes])
    if not finite.all():
        planes = [np.where(finite, plane, np.float32(0)) for plane in planes]
    counted, total = weight(planes, slices), sum(slices)

    def apart(i: int, j: int) -> Plane:
        scale = 1 / math.sqrt((1 / slices[i] + 1 / slices[j]) * total)
        difference: Plane = np.float32(scale) * (planes[i] - planes[j])
        return difference

    def paired(i: int, j: int, k: int, l: int) -> tuple[Plane, Plane]:  # noqa: E741
        one, other, by, also_by = apart(i, j), apart(k, l), counted(k, l), counted(i, j)
        error = (np.square(one) * by + np.square(other) * also_by).sum(axis=0) / 2
        return error, (one * other * ((by + also_by) / 2)).sum(axis=0)

    judged, first = paired(0, 2, 1, 3)
    (one, second), (other, third) = paired(0, 1, 2, 3), paired(0, 3, 1, 2)
    return finite, judged, one + other - judged, first, second, third


def plain(_planes: list[Any], _slices: Sequence[int]) -> Callable[[int, int], Any]:
    """Weigh all errors alike: the mean squared error."""
    return lambda _one, _other: np.float32(1)


def relative(planes: list[Any], _slices: Sequence[int]) -> Callable[[int, int], Any]:
    """Divide by truth² + ε: relMSE.

    The truth is taken from the quarters that are not in the difference, as noise that is in both
    biases the ratio: of a firefly it would make a small error. What the curve of 1/x² makes of
    their own noise is taken away by the jackknife.
    """
    apart = [_inverse(plane) for plane in planes]
    both = {
        pair: 2 * _inverse((planes[pair[0]] + planes[pair[1]]) / 2)
        - (apart[pair[0]] + apart[pair[1]]) / 2
        for pair in combinations(range(4), 2)
    }
    return lambda one, other: both[one, other]


def _inverse(plane: Plane) -> Plane:
    inverse: Plane = 1 / (np.square(plane) + np.float32(EPSILON))
    return inverse


def relative_error(mean: float) -> float:
    """Return what the jackknife of `relative` leaves: about the square of what it takes."""
    return (8 * mean) ** 2


def on_display(show: Callable[[Image], Image]) -> Weight:
    """Weigh errors by how much of them a display shows, from (H, W, 3) to values in [0, 1].

    A quarter is noisier than the image, and is clipped where the image is not. So the error is that
    of radiance, times the squared slope of the display between the image and what it would be
    without its least and its greatest quarter: a firefly that shows as white is less of an error.
    """

    def weight(planes: list[Any], slices: Sequence[int]) -> Callable[[int, int], Any]:
        image = sum(one * plane for one, plane in zip(slices, planes, strict=True)) / sum(slices)
        middle = (sum(planes) - np.minimum.reduce(planes) - np.maximum.reduce(planes)) / 2
        step = image - middle
        # Wide enough to divide by, also where the display mixes the channels.
        least = np.maximum(np.abs(step).max(axis=0) / 16, 1e-3 * np.abs(image) + np.float32(1e-6))
        step = np.where(np.abs(step) < least, least, step)
        shown, without = (show(np.moveaxis(one, 0, -1)) for one in (image, image - step))
        slope = np.square(np.moveaxis(shown - without, -1, 0) / step)
        return lambda _one, _other: slope

    return weight


def ratio_quantile(z: float, freedom: float, other: float) -> float:
    """Return the quantile of Fisher's F at `z` normal deviations: a ratio of two mean squares.

    References
    ----------
    E. Paulson, An approximate normalization of the analysis of variance distribution, Annals of
    Mathematical Statistics 13(2), 1942.

    Examples
    --------
    >>> [round(ratio_quantile(z, 20, 40), 2) for z in (-1.96, 1.96)]  # as in tables
    [0.44, 2.07]
    """
    b, d = 2 / (9 * freedom), 2 / (9 * other)
    a, c = 1 - b, 1 - d
    below = c * c - z * z * d
    if below <= 0:
        return math.inf
    root = math.sqrt(c * c * b + a * a * d - z * z * b * d)
    return max((a * c + z * root) / below, 0.0) ** 3
