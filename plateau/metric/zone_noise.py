"""How the visible noise of each zone of an image falls with more samples.

A zone near the target has no or one visible pixel, so its own count says little. More is known from
noise of other amounts: how many of its pixels a quarter, half, twice or four times the noise would
make visible. A model with two numbers explains these counts: how far the noise of the zone's middle
pixel is from the threshold, and how much its pixels differ from each other. What is not known of
the two stays in the answer, as a mean over all their values by their likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from plateau.metric.estimate import mean_clump

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.display import Mask
    from plateau.metric.estimate import Estimate
    from plateau.metric.noise_model import NoiseModel
    from plateau.metric.vdp import Percept, VisibleDifferences

    Floats: TypeAlias = NDArray[np.float64]

#: Amounts of noise to evaluate, as factors of the present noise, the smallest first. At 1 the
#: estimate is known already. The sign alternates, so that no sample of noise counts alone.
AMOUNTS: Final = (-0.25, 0.5, -(0.5**0.5), 1.0, 2**0.5, -2.0, 4.0)
#: Clumps are measured where at most this share of the pixels is visible: more touch by chance.
_SPARSE: Final = 0.05
#: Logarithms of a zone's noise: the standard deviation of its middle pixel over the threshold.
_LEVELS: Final = np.linspace(math.log(0.02), math.log(20), 32)
#: Standard deviations of that logarithm among the pixels of one zone.
_SPREADS: Final = (0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3)
#: The share of a zone's pixels that are outliers, such as fireflies, and the factor of their noise.
_OUTLIERS: Final = (0.0, 0.01)
_OUTLIER_FACTOR: Final = 8.0
#: How likely zones with such shares are before any count is seen, as shares of all zones.
_FIRST: Final = (0.9, 0.1)
#: Rounds of expectation maximisation, which find how zones of this image are distributed.
_ROUNDS: Final = 10
#: The least share of all spreads together, and the least spread of the levels of zones.
_LEAST_SHARE, _LEAST_SCATTER = 0.01, 0.2
#: The least probability of a level over that of the expected one: no zone is beyond belief.
_LEAST_CHANCE: Final = 1e-6
#: How much of a zone's expected level, before its counts are seen, is that of its neighbours.
_NEIGHBOURS: Final = 0.5
#: The forecast's samples, as factors of the present ones.
GROWTH: Final = 1.15 ** np.arange(48.0)


@dataclass(frozen=True, eq=False)
class ZoneCurves:
    """What is expected of each zone of an image as its samples grow."""

    #: Visible pixels of each zone at `GROWTH` times its present samples, (rows, columns, growths).
    visible: Floats
    #: Pixels of each zone that are finite, (rows, columns).
    pixels: Floats


def zone_curves(
    metric: VisibleDifferences, model: NoiseModel, clean: Percept, estimate: Estimate, size: int
) -> ZoneCurves:
    """Return how the visible pixels of each zone are expected to fall with its samples.

    Parameters
    ----------
    metric, model, clean, estimate
        The predictor, the merged image's noise model, its clean percept, and the estimate.
    size
        Side of the zones in pixels. Those at the right and lower edges may be smaller.

    Notes
    -----
    It takes six comparisons beyond the estimate. Noise is taken for normal, and the logarithm of
    its standard deviation for normal among the pixels of a zone, but for a few outliers. Levels of
    zones are taken for normal too, around a mean between the image's and that of a zone's eight
    neighbours (empirical Bayes). Pixels of one clump count as one.
    """
    seen, clump = _seen(metric, model, clean, estimate)
    sums = np.stack([zone_sums(mask, size) for mask in seen], axis=-1)
    pixels = zone_sums(~model.non_finite, size)
    # Pixels by the least of these amounts of noise that makes them visible.
    counts = np.diff(sums, axis=-1, prepend=0.0, append=pixels[..., np.newaxis]) / clump
    share = _visible_shares(np.abs(AMOUNTS))
    chance = np.diff(share, axis=-1, prepend=0.0, append=1.0)
    likelihood: Floats = np.einsum("yxb,slb->yxsl", counts, np.log(np.maximum(chance, 1e-9)))
    likelihood = np.exp(likelihood - likelihood.max(axis=(2, 3), keepdims=True))
    belief = _belief(likelihood)
    visible = np.einsum("yxsl,slg->yxg", belief, _visible_shares(GROWTH**-0.5))
    return ZoneCurves(visible * pixels[..., np.newaxis], pixels)


def zone_sums(plane: NDArray[np.generic], size: int) -> Floats:
    """Return the sum over each zone of a plane, (H, W) to (rows, columns) float64.

    Examples
    --------
    >>> zone_sums(np.ones((32, 40)), 16).tolist()
    [[256.0, 256.0, 128.0], [256.0, 256.0, 128.0]]
    """
    height, width = plane.shape
    rows = np.add.reduceat(plane.astype(np.float64), np.arange(0, height, size), axis=0)
    sums: Floats = np.add.reduceat(rows, np.arange(0, width, size), axis=1)
    return sums


def _seen(
    metric: VisibleDifferences, model: NoiseModel, clean: Percept, estimate: Estimate
) -> tuple[list[Floats], float]:
    """Return which pixels are visible at each amount of noise; and the mean clump."""
    seen: list[Floats] = []
    clump = 1.0
    for amount in AMOUNTS:
        if amount == 1:
            visible = estimate.visible.astype(np.float64)
        else:
            found: Mask = metric.compare(clean, metric.percept(model.noisy(amount))).visible
            found &= ~model.non_finite
            visible = found.astype(np.float64)
        if not seen or np.count_nonzero(visible) <= _SPARSE * visible.size:
            clump = mean_clump(visible > 0)
        # More noise also masks more; a pixel that less noise makes visible counts as visible.
        seen.append(np.maximum(seen[-1], visible) if seen else visible)
    return seen, clump


def _belief(likelihood: Floats) -> Floats:
    """Return the probability of each spread and level, given the counts of all zones.

    `likelihood` is that of each zone's counts, (rows, columns, spreads, levels).
    """
    rows, columns, _, _ = likelihood.shape
    first = np.repeat(_FIRST, len(_SPREADS)) / len(_SPREADS)
    of_spread = first
    expected, scatter = np.full((rows, columns), _LEVELS.mean()), 1.5
    for _ in range(_ROUNDS):
        away = (_LEVELS - expected[..., np.newaxis]) / scatter
        of_level = np.exp(-np.square(away) / 2) + _LEAST_CHANCE
        of_level /= of_level.sum(axis=-1, keepdims=True)
        belief: Floats = likelihood * of_level[:, :, np.newaxis, :] * of_spread[:, np.newaxis]
        belief /= belief.sum(axis=(2, 3), keepdims=True)
        of_spread = belief.mean(axis=(0, 1)).sum(axis=-1) * (1 - _LEAST_SHARE)
        of_spread += _LEAST_SHARE * first
        levels = belief.sum(axis=2)
        level = (levels * _LEVELS).sum(axis=-1)
        expected = (1 - _NEIGHBOURS) * level.mean() + _NEIGHBOURS * _around(level)
        off = np.square(_LEVELS - expected[..., np.newaxis])
        scatter = max(math.sqrt(float((levels * off).sum(axis=-1).mean())), _LEAST_SCATTER)
    return belief


def _around(level: Floats) -> Floats:
    """Return the mean of the eight neighbours of each zone; beyond a border the zone at it."""
    rows, columns = level.shape
    bordered = np.pad(level, 1, mode="edge")
    around: Floats = -level
    for y, x in np.ndindex(3, 3):
        around += bordered[y : y + rows, x : x + columns]
    around /= 8
    return around


def _visible_shares(amounts: Floats) -> Floats:
    """Return the share of pixels visible at amounts of noise, (spreads, levels, amounts)."""
    grid, shares = _share_table()
    at = _LEVELS[:, np.newaxis] + np.log(amounts)
    regular, irregular = (
        np.stack([np.interp(at + math.log(factor), grid, share) for share in shares])
        for factor in (1.0, _OUTLIER_FACTOR)
    )
    return np.concatenate([regular + some * (irregular - regular) for some in _OUTLIERS])


@cache
def _share_table() -> tuple[Floats, list[Floats]]:
    """Return logarithms of noise, and for each spread the share of pixels above the threshold."""
    grid = np.linspace(math.log(1e-5), math.log(1e5), 2401)
    share = np.array([math.erfc(math.exp(-one) / math.sqrt(2)) for one in grid])
    deviations = np.linspace(-4, 4, 81)
    weights = np.exp(-np.square(deviations) / 2)
    weights /= weights.sum()
    mixed = [
        sum(
            (
                weight * np.interp(grid + spread * away, grid, share)
                for weight, away in zip(weights, deviations, strict=True)
            ),
            start=np.zeros_like(grid),
        )
        for spread in _SPREADS
    ]
    return grid, mixed
