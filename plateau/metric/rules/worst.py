"""Plateau's rule for the worst place: stop when even there the image is good enough."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from plateau.metric.rules.jod import Jod
from plateau.rules import ParameterRole, parameter

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from plateau.metric.display import Plane
    from plateau.metric.quality import Quality
    from plateau.metric.rules.evidence import Evidence

#: Sides in degrees: of a part of the image, as large as a zone of SIN3D's images at 20 pixels per
#: degree, and of a patch, which the fovea sees at once.
PART_DEG: Final = 10.0
PATCH_DEG: Final = 1.0
#: So many of a hundred patches of a part lose no more than its worst place.
PERCENTILE: Final = 95.0
#: The quality of a place in which nobody sees an error, in JOD.
_BEST: Final = 10.0


@dataclass(kw_only=True)
class Worst(Jod):
    """Stops when the quality of the worst place is surely at least `target`, in two evaluations.

    It is `Jod` with another number: 10 less what the worst place loses by the map of what is lost
    (`worst_place`). So noise in one corner is not made up for by the rest. It has the doubt of the
    image's quality: as much more may be lost, as a share.

    Notes
    -----
    By zones, samples go where the quality of the whole image needs them, as for `Jod`: the job
    stops by its worst place, but its zones are not chosen by it.

    It is forecast as if the whole image lost less by the same share. While very much is lost, that
    may be too soon by half.

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

    def _quality(self, evidence: Evidence) -> Quality | None:
        from plateau.metric.quality import LEAST_LOST, Quality

        whole = evidence.quality
        if whole is None or whole.heat is None:
            return None
        width = whole.heat.shape[1]
        lost = _BEST * worst_place(whole.heat, width / evidence.metric.view.width_deg(width))
        doubt = (_BEST - whole.low_jod) / max(_BEST - whole.jod, LEAST_LOST)
        return Quality(_BEST - lost, _BEST - lost * max(doubt, 1.0))

    def _foretold(self, evidence: Evidence) -> int | None:
        seen, whole = self._quality(evidence), evidence.quality
        if seen is None or whole is None or seen.jod >= self.target:
            return None if seen is None else evidence.spp
        share = (_BEST - self.target) / (_BEST - seen.jod)
        return evidence.quality_forecast(_BEST - share * (_BEST - whole.jod))


def worst_place(heat: Plane, pixels_per_degree: float) -> float:
    """Return what the worst place of a map loses, in the unit of the map.

    Parameters
    ----------
    heat
        What is lost where, (H, W), finite.
    pixels_per_degree
        Of the view, above 0.

    Notes
    -----
    It is the most, over parts of about 10 by 10 degrees, of the 95th percentile of the means of all
    patches of a degree that lie within the part. A part is at most the image, and a patch at most
    the part, and at least a pixel. Sums are taken in the order of the pixels, so it has the same
    bits on every machine.

    Examples
    --------
    >>> import numpy as np
    >>> heat = np.zeros((400, 400), np.float32)
    >>> heat[300:310, 90:100] = 0.5  # a spot of half a degree is in less than 5 % of the patches
    >>> worst_place(heat, 20.0)
    0.0
    >>> heat[200:260, 40:100] = 0.5  # three degrees are in more
    >>> worst_place(heat, 20.0)
    0.5
    """
    import numpy as np

    side = max(1, round(PATCH_DEG * pixels_per_degree))
    return max(
        float(np.percentile(patch_means(heat[rows, columns], side), PERCENTILE))
        for rows in _parts(heat.shape[0], pixels_per_degree)
        for columns in _parts(heat.shape[1], pixels_per_degree)
    )


def _parts(pixels: int, pixels_per_degree: float) -> Iterator[slice]:
    """Yield parts that are as equal as may be."""
    count = max(1, round(pixels / (PART_DEG * pixels_per_degree)))
    for number in range(count):
        yield slice(number * pixels // count, (number + 1) * pixels // count)


def patch_means(part: Plane, side: int) -> NDArray[np.float64]:
    """Return the mean of each patch within a part: a square of `side` pixels, or fewer."""
    import numpy as np

    means = np.asarray(part, np.float64)
    for _ in range(2):  # down, and then across
        least = min(side, len(means))
        sums = np.zeros((len(means) + 1, means.shape[1]))
        np.cumsum(means, axis=0, out=sums[1:])
        means = ((sums[least:] - sums[:-least]) / least).T
    return means
