"""When a denoised image is looked at: its points of the curve, which cost more than others.

A look takes three runs of a denoiser, as much as some twenty samples per pixel of a cheap scene.
One that cannot end the job is wasted, and one that comes late wastes samples. So each look says
when the next one comes: where the job is expected to end. It does so by the image alone, and thus
the curve depends on no clock.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

#: By what the samples grow from one look to the next: the least, and the most.
LEAST_GROWTH: Final = 1.25
MOST_GROWTH: Final = 1.5
#: Steps that may always lie between two looks.
FREE_STEPS: Final = 2


@dataclass(frozen=True)
class Looks:
    """The looks at the image of a job.

    Attributes
    ----------
    step : int
        The distance of points, of which a look is a multiple, in spp.
    last : int
        The look at the cap, in spp.
    spp : tuple of int
        Samples per pixel at those that are known, and at the next one; they rise.
    """

    step: int
    last: int
    spp: tuple[int, ...]

    @classmethod
    def after(cls, seen: Sequence[tuple[int, int | None]], step: int, last: int) -> "Looks":
        """Return the looks of a job that had these: their spp, and where the job was to end."""
        first = cls(step, last, tuple(spp for spp, _ in seen) or (min(step, last),))
        return first.with_look(*seen[-1]) if seen else first

    def __contains__(self, spp: int) -> bool:
        return spp in self.spp or spp == self.last

    def first_from(self, spp: int) -> int | None:
        """Return the first one that is known with so many samples per pixel; None if none is."""
        return next((look for look in self.spp if look >= spp), None)

    def with_look(self, spp: int, expected_spp: int | None) -> "Looks":
        """Return them with the look after the one at this spp, unless that is known."""
        if spp < self.spp[-1]:
            return self
        following = min(next_look(spp, self.step, expected_spp), self.last)
        return replace(self, spp=tuple(sorted({*self.spp, spp, following})))


def next_look(spp: int, step: int, expected_spp: int | None) -> int:
    """Return the samples per pixel at the next look.

    Parameters
    ----------
    spp
        At this look, 1 or more.
    step
        The distance of points, of which a look is a multiple, in spp.
    expected_spp
        Where the job is expected to end; None if nobody knows.

    Examples
    --------
    >>> next_look(100, 100, 2500), next_look(300, 100, 450), next_look(2000, 100, 2100)
    (300, 500, 2500)
    """
    least = max(spp // step + 1, round(LEAST_GROWTH * spp / step))
    most = max(spp // step + FREE_STEPS, round(MOST_GROWTH * spp / step))
    wanted = least if expected_spp is None else math.ceil(expected_spp / step)
    return step * max(least, min(wanted, most))
