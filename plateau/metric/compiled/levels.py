"""One image's rows of luminance, colour and blurred levels, computed one after the other.

A row of a level needs two further rows of the level before. So row n of the sharp level is followed
by row n - 2i of level i, and the kernels hold rings of a few rows, which stay in a core's cache. A
kept percept has rings as high as the image, which hold all of it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.metric.compiled.jit import inlined, kernel
from plateau.metric.compiled.light import KernelView, blacken, luminance, opponent, response, show
from plateau.metric.display import Mask, Plane
from plateau.metric.pyramid import KERNEL, LEVELS, REACH

#: Rows after which a row is done on every level.
DELAY = REACH * (LEVELS - 1)
#: Rows of a ring: from the row that is done on every level to the newest sharp row.
RING_ROWS = DELAY + 1
#: Planes of a percept: the levels, then a* and b* unless luminance alone is judged.
A_STAR, B_STAR = LEVELS, LEVELS + 1

#: Pixels for which each step is one loop: few enough to stay in the first cache.
SLICE = 128

_TAPS = 2 * REACH + 1
_CENTRE, _NEAR, _FAR = (np.float32(tap) for tap in KERNEL)


class Side(NamedTuple):
    """One of the two images with its computed planes."""

    #: (H, 3 W), interleaved.
    image: Plane
    #: Rings of rows, (planes, rows, W): row y lies in slot y modulo the number of rows.
    planes: Plane
    #: Each level's newest rows, blurred along the row: (levels - 1, 5, W).
    across: Plane
    #: Which pixels are not finite, (H, W).
    non_finite: Mask


@kernel
def make_row(side: Side, n: int, screen: KernelView, work: Plane) -> int:
    """Compute row n of the sharp level and every row of other levels that it completes.

    `work` is scratch space, (6, SLICE). Returns how many pixels of row n are not finite.
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
def _light_row(side: Side, n: int, screen: KernelView, work: Plane) -> int:
    """Compute row n of luminance and colour from the image."""
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


# The order of the sums is that of `plateau.metric.pyramid`, which gives the same bits.


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
    """Return `plateau.metric.pyramid.border_index`."""
    while not 0 <= index < size:
        index = -index if index < 0 else 2 * size - index - 1
    return index


def rings(rows: int, width: int, *, chromatic: bool) -> Plane:
    """Return uninitialised rings of this many rows for every plane."""
    planes: NDArray[np.float32] = np.empty(
        (LEVELS + 2 if chromatic else LEVELS, rows, width), np.float32
    )
    return planes


def across(width: int) -> Plane:
    """Return uninitialised space for rows blurred along the row."""
    space: NDArray[np.float32] = np.empty((LEVELS - 1, _TAPS, width), np.float32)
    return space
