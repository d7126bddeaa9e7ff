"""Plateau's rule for the worst place: stop when even there the image is good enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from plateau.metric.rules.jod import Jod
from plateau.rules import ParameterRole, parameter


@dataclass(kw_only=True)
class Worst(Jod):
    """Stops when the quality of the worst place is surely at least `target`, in two evaluations.

    It is `Jod` with another number: 10 less what the worst place loses by the heat map of
    ColorVideoVDP. The worst place is the 95th percentile of patches of a degree, in that part of
    ten degrees where it is greatest (`plateau.metric.places`). So noise in one corner is not made
    up for by the rest.

    Notes
    -----
    By zones, samples go where the quality of the whole image needs them, as for `Jod`: the job
    stops by its worst place, but the zones are not chosen by it.

    Beside people's thresholds it is not shown to be better than `Jod`: docs/science/people.md.
    """

    name: ClassVar[str] = "worst"
    summary: ClassVar[str] = (
        "Stop when the image is nearly as good as the converged one even in its worst place, by "
        "ColorVideoVDP."
    )
    title: ClassVar[str] = "Good enough in the worst place"
    help: ClassVar[str] = (
        "Stops when ColorVideoVDP finds even the worst place of the image nearly as good as in the "
        "converged one, so that no corner stays noisy."
    )
    criterion: ClassVar[str] = (
        "the quality of the worst place by ColorVideoVDP is surely ≥ `target` JOD, twice, "
        "n ≥ `min_spp`"
    )
    order: ClassVar[int] = 8
    featured: ClassVar[bool] = False
    quantity: ClassVar[str] = "quality in the worst place"
    by_worst_place: ClassVar[bool] = True

    #: The quality to reach there, in JOD.
    target: float = parameter(
        9.7,
        1.0,
        9.99,
        description="quality of the worst place against the converged image to reach, in JOD: 10 "
        "is the best",
        label="Quality to reach in the worst place",
        unit="JOD",
        help="10: nobody sees a difference in any place.",
        role=ParameterRole.VALUE_TARGET,
    )
