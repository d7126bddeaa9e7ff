"""Decides a round of a job that is allocated by zones, by the image of an earlier one."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.metric import Evidence
from plateau.picture.canvas import areas_of

#: The samples of a slice, as a share of those of a slice of the whole film. Only two rounds are
#: decided at a time, and they are to keep many workers busy.
SLICE_SHARE: Final = 0.5


class Allotment(NamedTuple):
    """What an image decides.

    Attributes
    ----------
    round : Round
        The round after those that are decided.
    forecast_spp : int
        Samples per pixel, as a mean over the film, at which the target is reached.
    """

    round: Round
    forecast_spp: int


def allotment(
    evidence: Evidence,
    target: float,
    plan: Plan,
    spp: NDArray[np.int64],
    *,
    quality_target: float | None = None,
) -> Allotment:
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
    quality_target
        The quality to reach, in JOD, if that counts instead of the noise.
    """
    grid = plan.grid
    allocated = evidence.allocation(
        target, spp=spp, planned=_planned(plan), size=grid.size, quality_target=quality_target
    )
    assert allocated is not None  # the image is that of a round, which has two halves
    chosen = np.flatnonzero(allocated.zones)
    areas = areas_of(grid).ravel()
    area = int(areas[chosen].sum())
    slice_spp = max(1, round(plan.slice_spp * SLICE_SHARE * plan.pixels / area))
    needed = float(areas @ allocated.needed.ravel())
    return Allotment(
        plan.round_of(chosen.tolist(), allocated.spp, slice_spp), math.ceil(needed / plan.pixels)
    )


def _planned(plan: Plan) -> NDArray[np.int64]:
    """Return the samples per pixel of each zone after all rounds that are decided."""
    whole = plan.stop - sum(one.slices for one in plan.decided)
    spp = np.full(plan.grid.rows * plan.grid.columns, whole * plan.slice_spp)
    for one in plan.decided:
        zones = slice(None) if one.zones is None else list(one.zones)
        spp[zones] += one.slices * one.spp
    return spp.reshape(plan.grid.rows, plan.grid.columns)
