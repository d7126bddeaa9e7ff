"""The error of a merged image against the converged one, known without it.

The slices form four quarters, whose means are the truth plus independent errors. Half the squared
difference of two quarters, scaled to all samples, is the squared error of the merged image without
bias: it differs from the true one by products of errors of different quarters alone. Products of
differences without a common quarter are of that kind, and say how far off the estimate may be.

The differences within the even and within the odd slices judge (two of the three contrasts of four
quarters), and the contrast of even and odd slices decides. So no estimate is reported because it
was low by chance.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from plateau.metric.display import Image, Plane
from plateau.metric.zone_noise import zone_sums

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
    #: As many independent normal errors of one size would be as uncertain, 1 to 1e9.
    freedom: float
    #: What `FEW` of the pixels hold of it, in [0, 1].
    few_share: float
    non_finite: int
    #: The same mean for each tile: twice by the samples that judge, and by those that decide.
    tiles: NDArray[np.float64] = field(repr=False)

    def at_share(self, share: float) -> tuple[float, ...]:
        """Return mean, low, high and sure of the tile of which a share of them has no more.

        Each of the three has the law of a tile's true error. So the tiles of which two are on
        different sides of the quantile tell by how many the truth may have more or fewer there.
        """
        judged, decided = self.tiles[:2], self.tiles[2]
        apart = 1 + np.count_nonzero(np.diff(judged > np.quantile(judged, share), axis=0))
        spread = _NORMAL * math.sqrt(apart) / decided.size
        off = 0.87 * spread  # √(3/4)
        shares = share, max(share - off, 0), share + off
        return *(_at(judged, one) for one in shares), _at(decided, share + spread)


def _at(tiles: NDArray[np.float64], share: float) -> float:
    """Return the quantile, which goes on beyond the greatest tile as it came there."""
    top, below = np.quantile(tiles, [min(share, 1), max(min(2 - share - 1 / tiles.size, 1), 0)])
    return float(top if share <= 1 or not below else top * top / below)


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
    The degrees of freedom f are the square of the mean over Σ cov², summed over all pairs of pixels
    and channels within blocks. The logarithm of the truth over the estimate has a variance of about
    3/f, and over that of the deciding samples 4/f. Where hits are so rare that no block has two of
    them in different quarters, Σ cov² is at least that of light that falls anywhere in its block.
    With b blocks that matter, deviations are those of Student's t with 2b degrees of freedom.

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
    bands = (
        _band([mean[top : top + _BAND] for mean in quarters.means], quarters.slices, weight)
        for top in range(0, len(quarters.means[0]), _BAND)
    )
    finite, judged, decided, *crossed = map(np.concatenate, zip(*bands, strict=True))
    pixels = zone_sums(finite, BLOCK)
    values = 3 * float(pixels.sum()) or 1.0
    # A sum below zero is off by its own size at least.
    held, other = (abs(float(one.sum(dtype=np.float64))) for one in (judged, decided))
    few = max(1, math.ceil(FEW * judged.size))
    most = float(np.partition(judged, -few, axis=None)[-few:].sum(dtype=np.float64))

    squares = np.mean([np.square(zone_sums(one, BLOCK)) for one in crossed], axis=0)
    anywhere = np.square(zone_sums(judged, BLOCK)) / (3 * np.maximum(pixels, 1))
    squares = max(squares, anywhere, key=np.sum)
    summed, whole = float(squares.sum()), (2 * held + other) / 3
    blocks = summed**2 / float(np.square(squares).sum()) if summed else math.inf
    uncertain = summed + (whole * model_error(held / values)) ** 2 / 3
    freedom = max(whole**2 / max(uncertain, 1e-9 * whole**2), 1.0) if whole else 1e9
    z = (_NORMAL + 1.2 / blocks) / math.sqrt(freedom)
    same, cross, apart = (zone_sums(one, TILE) for one in (judged, crossed[0], decided))
    return SquaredError(
        mean=held / values,
        low=held / values * math.exp(-z * math.sqrt(3)),
        high=held / values * math.exp(z * math.sqrt(3)),
        sure=other / values * math.exp(2 * z),
        freedom=freedom,
        few_share=min(most / held, 1.0) if held else 0.0,
        non_finite=finite.size - int(np.count_nonzero(finite)),
        tiles=np.abs([same + cross, same - cross, apart])
        / (3 * np.maximum(zone_sums(finite, TILE), 1)),
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

    The truth is taken from the quarters that are not in the difference: of a firefly in both, the
    ratio would make a small error. What the curve of 1/x² makes of their own noise, the jackknife
    takes away. It leaves about the square of that: up to (12 relMSE)² of the whole was measured.
    """
    apart = [1 / (np.square(plane) + np.float32(EPSILON)) for plane in planes]
    both = {
        (i, j): 2 / (np.square((planes[i] + planes[j]) / 2) + np.float32(EPSILON))
        - (apart[i] + apart[j]) / 2
        for i, j in combinations(range(4), 2)
    }
    return lambda one, other: both[one, other]


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
