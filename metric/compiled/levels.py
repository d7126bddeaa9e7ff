"""One image's rows of luminance, colour and blurred levels, made one after the other.

A level's row needs two rows more of the level before. So while row n of the sharp level is made,
row n - 2i of level i follows, and rings of a few rows are all that has to be held: they stay in a
core's cache. A ring as high as the image holds the whole of it; that is how a percept is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from plateau.metric.compiled.jit import inlined, kernel
from plateau.metric.compiled.light import Screen, blacken, luminance, opponent, response, show
from plateau.metric.pyramid import KERNEL, LEVELS, REACH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.display import Mask, Plane

#: So many rows after its own, a row is done on every level.
DELAY = REACH * (LEVELS - 1)
#: How many rows of each level a ring holds: from the row that is done to the sharp one's newest.
RING_ROWS = DELAY + 1
#: Planes of a percept: the levels, then a* and b* unless luminance alone is judged.
A_STAR, B_STAR = LEVELS, LEVELS + 1

#: Pixels that go through one step after the other together: few enough to stay next to the core.
SLICE = 128

_TAPS = 2 * REACH + 1
_CENTRE, _NEAR, _FAR = (np.float32(tap) for tap in KERNEL)


class Side(NamedTuple):
    """One of the two images, and what is made of it."""

    #: (H, 3 W), interleaved.
    image: Plane
    #: Rings of rows, (planes, rows, W): row y lies in slot y modulo the number of rows.
    planes: Plane
    #: Each level's newest rows, blurred along the row: (levels - 1, 5, W).
    across: Plane
    #: Which pixels are not finite, (H, W).
    non_finite: Mask


@kernel
def make_row(side: Side, n: int, screen: Screen, work: Plane) -> int:
    """Make row n of the sharp level and every further row that can then be made.

    `work` is (6, SLICE) of space. Returns how many pixels of row n are not finite.
    """
    height = side.image.shape[0]
    _, rows, width = side.planes.shape
    non_finite = 0
    if n < height:
        non_finite = _light_row(side, n, screen, work)
        _blur_across(side.planes[0, n % rows], side.across[0, n % _TAPS])
    for level in range(1, LEVELS):
        y = n - REACH * level
        if 0 <= y < height:
            finer = side.across[level - 1]
            row = side.planes[level, y % rows]
            _blur_down(
                finer[_border_index(y - 2, height) % _TAPS],
                finer[_border_index(y - 1, height) % _TAPS],
                finer[y % _TAPS],
                finer[_border_index(y + 1, height) % _TAPS],
                finer[_border_index(y + 2, height) % _TAPS],
                row,
                width,
            )
            if level < LEVELS - 1:
                _blur_across(row, side.across[level, y % _TAPS])
    return non_finite


@inlined
def _light_row(side: Side, n: int, screen: Screen, work: Plane) -> int:
    """Make row n of luminance and colour from the image."""
    count_of_planes, rows, width = side.planes.shape
    slot = n % rows
    image, marks = side.image[n], side.non_finite[n]
    red, green, blue, x, y, z = work[0], work[1], work[2], work[3], work[4], work[5]
    non_finite = 0
    for start in range(0, width, SLICE):
        count = min(SLICE, width - start)
        end = start + count
        pixels = image[3 * start : 3 * end]
        if show(pixels, screen.scale, red, green, blue, count):
            non_finite += blacken(pixels, red, green, blue, marks[start:end], count)
        sharp = side.planes[0, slot, start:end]
        luminance(red, green, blue, screen.y, screen.white_luminance, sharp, count)
        if count_of_planes > LEVELS:
            response(red, green, blue, screen.x, screen.per_white[0], x, count)
            response(red, green, blue, screen.y, screen.per_white[1], y, count)
            response(red, green, blue, screen.z, screen.per_white[2], z, count)
            a, b = side.planes[A_STAR, slot, start:end], side.planes[B_STAR, slot, start:end]
            opponent(x, y, z, a, b, count)
    return non_finite


# The order of the sums is that of `plateau.metric.pyramid`, for the same bits.


@inlined
def _blur_down(
    above2: Plane,
    above: Plane,
    here: Plane,
    below: Plane,
    below2: Plane,
    out: Plane,
    count: int,
) -> None:
    for i in range(count):
        far, near = above2[i] + below2[i], above[i] + below[i]
        out[i] = far * _FAR + near * _NEAR + here[i] * _CENTRE


@inlined
def _blur_across(row: Plane, out: Plane) -> None:
    width = row.size
    inside = width - 2 * REACH
    if inside > 0:
        _blur_down(row, row[1:], row[2:], row[3:], row[4:], out[REACH:], inside)
    for edge in range(min(width, 2 * REACH)):
        x = edge if edge < REACH or inside < 0 else edge + inside
        far = row[_border_index(x - 2, width)] + row[_border_index(x + 2, width)]
        near = row[_border_index(x - 1, width)] + row[_border_index(x + 1, width)]
        out[x] = far * _FAR + near * _NEAR + row[x] * _CENTRE


@inlined
def _border_index(index: int, size: int) -> int:
    """Return what `plateau.metric.pyramid.border_index` does."""
    while not 0 <= index < size:
        index = -index if index < 0 else 2 * size - index - 1
    return index


def rings(rows: int, width: int, *, chromatic: bool) -> Plane:
    """Return rings of that many rows for every plane, uninitialised."""
    planes: NDArray[np.float32] = np.empty(
        (LEVELS + 2 if chromatic else LEVELS, rows, width), np.float32
    )
    return planes


def across(width: int) -> Plane:
    """Return the space for rows blurred along themselves, uninitialised."""
    space: NDArray[np.float32] = np.empty((LEVELS - 1, _TAPS, width), np.float32)
    return space
