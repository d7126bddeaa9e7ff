"""When a denoised image is looked at: its points of the curve, which cost more than others.

A look takes three runs of a denoiser, as much as some twenty samples per pixel of a cheap scene.
One that cannot end the job is wasted, and one that comes late wastes samples. So each look says
when the next one comes: where the job is expected to end. It does so by the image alone, and thus
the curve depends on no clock.
"""

import math
from typing import Final

#: By what the samples grow from one look to the next: the least, and the most.
LEAST_GROWTH: Final = 1.25
MOST_GROWTH: Final = 1.5
#: Steps that may always lie between two looks.
FREE_STEPS: Final = 2


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
