"""Which zones of an image get the next samples, and how many.

The whole image is to have as few visible pixels as the target allows, with the fewest samples. That
is so when the last sample of every zone takes away equally many (Lagrange). `zone_curves` says how
the visible pixels of a zone fall. Where the target is a quality, see
`plateau.metric.quality_allocation`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plateau.metric.estimate import require_target
from plateau.metric.zone_noise import GROWTH, zone_curves

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.estimate import Estimate
    from plateau.metric.noise_model import NoiseModel
    from plateau.metric.vdp import Percept, VisibleDifferences
    from plateau.metric.zone_noise import Floats, ZoneCurves

#: Every zone has at least this share of the mean: no path may have found its light yet.
LEAST_SHARE: Final = 0.1


class RoundSizes(NamedTuple):
    """How many samples a round may have."""

    #: As a share of what seems to be needed: the next image knows better.
    share: float
    #: The range, as shares of the samples before it.
    least: float
    largest: float
    #: What a zone has at most, as a share of its own samples.
    of_zone: float


#: As long as an image costs little to judge, and where it is denoised for that.
SMALL_ROUNDS: Final = RoundSizes(share=0.25, least=0.025, largest=0.25, of_zone=0.5)
LARGE_ROUNDS: Final = RoundSizes(share=0.5, least=0.25, largest=0.5, of_zone=1.0)


@dataclass(frozen=True, eq=False)
class Allocation:
    """The next round of samples."""

    #: The zones that it has, (rows, columns); at least one.
    zones: NDArray[np.bool_]
    #: Samples per pixel of each of them.
    spp: int
    #: Samples per pixel of each zone when the whole image is expected to reach the target, (rows,
    #: columns); at least those that are planned, and in all a small round more.
    needed: NDArray[np.float64]


def plan_round(
    metric: VisibleDifferences,
    model: NoiseModel,
    clean: Percept,
    estimate: Estimate,
    target: float,
    *,
    spp: NDArray[np.int64],
    planned: NDArray[np.int64],
    size: int,
    sizes: RoundSizes = SMALL_ROUNDS,
) -> Allocation:
    """Return the zones and samples of the next round.

    Parameters
    ----------
    metric, model, clean, estimate
        The predictor, the noise model of the merged image, the percept of its clean image, and the
        estimate from them. The model should be that of other halves than those that judge the
        image: slices 0, 1, 4, 5, … and 2, 3, 6, 7, … where these are the even and the odd ones.
    target
        Fraction of the pixels that may be visible, between 0 and 1.
    spp
        Samples per pixel of each zone in the merged image, (rows, columns), 1 or more.
    planned
        The same after all rounds that are decided already, at least `spp`.
    size
        Side of the zones in pixels. Those at the right and lower edges may be smaller.
    sizes
        How many samples the round may have.

    Raises
    ------
    ValueError
        If the target is not between 0 and 1, or `spp` and `planned` do not fit the image's zones.

    Notes
    -----
    It takes six comparisons beyond the estimate, and depends on its arguments alone. A round has at
    least 1 sample per pixel of the image on average.

    The noise of the other halves is uncorrelated with that of the judging ones. Who decides by the
    noise that judges gives samples where it is high by chance, and leaves it where it is low. So
    the estimate falls faster than the error.

    Examples
    --------
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> from plateau.metric.estimate import estimate_from
    >>> from plateau.metric.noise_model import noise_model
    >>> noise = np.random.default_rng(1).normal(0, 0.02, (2, 64, 64, 3)).astype(np.float32)
    >>> noise[:, :32, 32:] *= 4
    >>> even, odd = np.float32(0.4) + noise
    >>> metric = VisibleDifferences(View())
    >>> model = noise_model(metric, (even + odd) / 2, (Half(even, 50), Half(odd, 50)))
    >>> clean = metric.percept(model.clean)
    >>> estimate = estimate_from(metric, model, clean)
    >>> spp = np.full((2, 2), 100)
    >>> plan = plan_round(
    ...     metric, model, clean, estimate, 0.0005, spp=spp, planned=spp, size=32
    ... )
    >>> bool(plan.zones[0, 1]), bool(plan.needed[0, 1] > 4 * plan.needed[1, 0])
    (True, True)
    """
    require_target(target)
    height, width = model.non_finite.shape
    require_zones((-(-height // size), -(-width // size)), spp, planned)
    curves = zone_curves(metric, model, clean, estimate, size)
    allowed = target * model.pixels
    fewest = samples_after(planned, curves.pixels, sizes)
    needed = _needed(curves, spp, planned, allowed, fewest)
    return next_round(needed, planned, curves.pixels, sizes)


def _needed(
    curves: ZoneCurves,
    spp: NDArray[np.int64],
    planned: NDArray[np.int64],
    allowed: float,
    least: float,
) -> Floats:
    """Return the cheapest samples per pixel with at most `allowed` visible pixels, (rows, columns).

    They are at least so many samples in all that the next round can be chosen from them. If none
    within reach are enough, they are the most that are.
    """
    samples = np.maximum(spp[..., np.newaxis] * GROWTH, planned[..., np.newaxis])
    logarithms = np.log(samples) - np.log(spp)[..., np.newaxis]
    visible = _at(curves.visible, logarithms)
    cost = samples * curves.pixels[..., np.newaxis]

    def cheapest(price: float) -> NDArray[np.intp]:
        """Return the place of the least cost, if a visible pixel costs as much as `price`."""
        place: NDArray[np.intp] = (cost + price * visible).argmin(axis=-1)[..., np.newaxis]
        return place

    def is_enough(price: float) -> bool:
        place = cheapest(price)
        left, spent = (np.take_along_axis(one, place, -1).sum() for one in (visible, cost))
        return bool(left <= allowed and spent >= least)

    low, high = 0.0, math.log(1e15)  # of the price
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if is_enough(math.exp(middle)) else (middle, high)
    needed: Floats = np.take_along_axis(samples, cheapest(math.exp(high)), -1)[..., 0]
    return needed


def _at(visible: Floats, logarithms: Floats) -> Floats:
    """Return the curves at these logarithms of growth, both (rows, columns, places)."""
    place = np.minimum(logarithms / math.log(GROWTH[1]), len(GROWTH) - 1)
    below = np.minimum(place.astype(np.intp), len(GROWTH) - 2)
    left, right = (np.take_along_axis(visible, below + one, -1) for one in (0, 1))
    between: Floats = left + (right - left) * (place - below)
    return between


def require_zones(
    shape: tuple[int, ...], spp: NDArray[np.int64], planned: NDArray[np.int64]
) -> None:
    """Raise ValueError unless these are samples of as many zones as the image has."""
    if spp.shape != shape or planned.shape != shape:
        raise ValueError(f"{shape} zones need as many spp, not {spp.shape} and {planned.shape}")


def samples_after(planned: NDArray[np.int64], pixels: Floats, sizes: RoundSizes) -> float:
    """Return the samples over all pixels after the least round; parameters as for `next_round`."""
    total, least = _total_and_least(planned, pixels, sizes)
    return total + least


def _total_and_least(
    planned: NDArray[np.int64], pixels: Floats, sizes: RoundSizes
) -> tuple[float, float]:
    total = float((planned * pixels).sum())
    return total, max(sizes.least * total, float(pixels.sum()))


def next_round(
    needed: Floats, planned: NDArray[np.int64], pixels: Floats, sizes: RoundSizes
) -> Allocation:
    """Return the next round, with the neediest zones; each needs `LEAST_SHARE` of the mean.

    Parameters
    ----------
    needed, planned
        Samples per pixel that each zone needs in the end, and has by all rounds so far.
    pixels
        Of each zone.
    sizes
        How many samples the round may have.
    """
    needed = np.maximum(needed, LEAST_SHARE * float((needed * pixels).sum() / pixels.sum()))
    _, least = _total_and_least(planned, pixels, sizes)
    missing = np.maximum(needed - planned, 0.0).ravel()
    so_far = planned.ravel().astype(np.float64)
    areas = pixels.ravel()
    if not missing.any():  # nothing can be seen at all: those with the fewest samples
        missing += so_far.max()
    wanted = sizes.share * float((missing * areas).sum())
    wanted = max(min(wanted, sizes.largest * float((so_far * areas).sum())), least)
    # Of the first zones in this order each takes as much as the least needy of them needs.
    order = np.argsort(-missing / so_far, kind="stable")
    each = np.minimum.accumulate(np.minimum(missing, sizes.of_zone * so_far)[order])
    area = np.cumsum(areas[order])
    enough = np.flatnonzero(each * area >= wanted)
    last = int(enough[0]) if enough.size else int(np.argmax(each * area))
    zones = np.zeros(needed.size, np.bool_)
    zones[order[: last + 1]] = True
    spp = math.ceil(max(float(each[last]), least / float(area[last])))
    return Allocation(zones.reshape(needed.shape), spp, needed)
