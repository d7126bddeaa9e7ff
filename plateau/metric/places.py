"""The worst place of an image: where a heat map of ColorVideoVDP says that most is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from plateau.metric.display import Plane

#: Side of a part of the image that is looked at by itself, in degrees: a zone of SIN3D's images at
#: 20 pixels per degree.
PART_DEG: Final = 10.0
#: Side of a patch, in degrees: what the fovea sees at once.
PATCH_DEG: Final = 1.0
#: So many of a hundred patches of a part lose no more than its worst place.
PERCENTILE: Final = 95.0


def worst_place(heat: Plane, pixels_per_degree: float) -> float:
    """Return what the worst place of an image loses.

    Parameters
    ----------
    heat
        Where it is seen, (H, W), in any unit, finite.
    pixels_per_degree
        Of the view, above 0.

    Returns
    -------
    float
        In the unit of the map: the most, over parts of about 10 by 10 degrees, of the 95th
        percentile of the means of all patches of 1 by 1 degree that lie within the part. A part or
        patch is at most the whole image, and a patch at least a pixel.

    Notes
    -----
    It depends on its arguments alone: sums are taken in the order of the pixels. So it has the same
    bits on every machine.

    Examples
    --------
    >>> heat = np.zeros((400, 400), np.float32)
    >>> heat[300:310, 90:100] = 0.5  # a spot of half a degree is in less than 5 % of the patches
    >>> worst_place(heat, 20.0)
    0.0
    >>> heat[200:260, 40:100] = 0.5  # three degrees are in more
    >>> worst_place(heat, 20.0)
    0.5
    """
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
    means = np.asarray(part, np.float64)
    for _ in range(2):  # down, and then across
        least = min(side, len(means))
        sums = np.zeros((len(means) + 1, means.shape[1]))
        np.cumsum(means, axis=0, out=sums[1:])
        means = ((sums[least:] - sums[:-least]) / least).T
    return means
