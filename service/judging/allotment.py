"""Decides a round of a job that is allocated by zones, by the image of an earlier one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from plateau.farm.model.passes import MOST_SLICE_SPP

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.farm.model.plan import Plan, Round
    from plateau.metric import Evidence


class Allotment(NamedTuple):
    """What an image decides.

    Attributes
    ----------
    round : Round
        The round after those that are decided.
    forecast_spp : int
        Samples per pixel, as a mean over the film, at which hardly any noise is left.
    """

    round: Round
    forecast_spp: int


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
    grid, slices = plan.grid, plan.round_slices
    allocated = evidence.allocation(
        target, spp=spp, planned=_planned(plan), size=grid.size, slices=slices
    )
    assert allocated is not None  # the image is that of a round, which has two halves
    chosen = np.flatnonzero(allocated.zones)
    areas = np.array([zone.width * zone.height for zone in grid.zones()])
    zones, slice_spp = chosen.tolist(), min(allocated.spp // slices, MOST_SLICE_SPP)
    if slice_spp * slices * areas[chosen].sum() < plan.pixels:  # too few for a point of the curve
        zones, slice_spp = None, 1
    needed = float(areas @ allocated.needed.ravel())
    return Allotment(plan.round_of(zones, slice_spp), math.ceil(needed / plan.pixels))


def _planned(plan: Plan) -> NDArray[np.int64]:
    """Return the samples per pixel of each zone after all rounds that are decided."""
    spp = np.zeros(plan.grid.rows * plan.grid.columns, np.int64)
    for index in range(plan.stop):
        one = plan.slice_round(index)
        zones = slice(None) if one is None or one.zones is None else list(one.zones)
        spp[zones] += plan.slice_spp_of(index)
    return spp.reshape(plan.grid.rows, plan.grid.columns)
