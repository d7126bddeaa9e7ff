"""Decides a round of a job that is allocated by zones, by the image of an earlier one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from plateau.farm.model.plan import Round

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.farm.model.plan import Plan
    from plateau.metric import Evidence

#: A round has at least this share of the samples before it, so that judging costs little.
_LEAST_SHARE: Final = 0.04


@dataclass(frozen=True)
class Allotment:
    """What an image decides.

    Attributes
    ----------
    round : Round
        The round after those that are decided.
    forecast_spp : int or None
        Mean samples per pixel at which hardly any noise is left; None where that is unknown.
    """

    round: Round
    forecast_spp: int | None


def allotment(evidence: Evidence, target: float, plan: Plan, spp: NDArray[np.int64]) -> Allotment:
    """Return what an image decides: a pure function of it, and of the plan.

    Parameters
    ----------
    evidence
        The image.
    target
        The noise that may be left, as a share of the pixels.
    plan
        The rounds that are decided before.
    spp
        Samples per pixel of each zone in the image, (rows, columns).
    """
    estimate = evidence.estimate
    assert estimate is not None
    grid, least = plan.grid, _least_samples(plan)
    shares = np.array(
        [
            estimate.visible[z.y : z.y + z.height, z.x : z.x + z.width].mean(dtype=np.float64)
            for z in grid.zones()
        ]
    ).reshape(spp.shape)
    rows, columns = spp.shape
    around = np.pad(shares, 1, mode="edge")
    near = np.max(
        [around[y : y + rows, x : x + columns] for y in range(3) for x in range(3)], axis=0
    )
    chosen = np.flatnonzero((shares > target) | (near / 2 > target))
    pixels = sum(zone.width * zone.height for zone in grid.zones(chosen.tolist()))
    slice_spp = plan.slice_spp
    if pixels:
        slice_spp = max(slice_spp, math.ceil(least / (plan.round_slices * pixels)))
    one = plan.round_of(chosen.tolist(), slice_spp) if pixels else None
    if one is None or one.spp * one.pixels * plan.round_slices < plan.pixels:
        one = plan.round_of(None, math.ceil(least / (plan.round_slices * plan.pixels)))
    return Allotment(one, None)


def _least_samples(plan: Plan) -> int:
    return max(plan.pixels, math.ceil(_LEAST_SHARE * plan.samples(plan.stop)))
