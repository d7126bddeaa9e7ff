"""Levels of halved size, and their expansion back, by a kernel of five taps.

A level is (channels, H, W); the next has ⌈H/2⌉ by ⌈W/2⌉ pixels.
"""

import numpy as np
from numpy.typing import NDArray

from plateau.metric.compiled.jit import entry_point, kernel
from plateau.metric.cvvdp.parameters import (
    BAND_FREQUENCY,
    BASE_FREQUENCY,
    KERNEL,
    LEAST_FREQUENCY,
)
from plateau.metric.display import Plane
from plateau.metric.rows import by_rows

_FAR, _NEAR, _CENTRE = (np.float32(tap) for tap in KERNEL[:3])
_TWICE_FAR, _TWICE_NEAR, _TWICE_CENTRE = (np.float32(2 * tap) for tap in KERNEL[:3])


def band_frequencies(shape: tuple[int, int], pixels_per_degree: float) -> NDArray[np.float64]:
    """Return the bands' frequencies in cycles per degree, from the finest to the base.

    Notes
    -----
    With the Nyquist frequency n of the image they are n, 0.3228 n, 0.1614 n and so on, until one is
    at most 0.2, or the image too small. The base is taken at 0.1.

    Examples
    --------
    >>> band_frequencies((256, 256), 10).round(3).tolist()
    [5.0, 1.614, 0.807, 0.403, 0.202, 0.101, 0.1]
    >>> band_frequencies((8, 8), 10).round(3).tolist()
    [5.0, 1.614, 0.1]
    """
    most = min(shape).bit_length() - 2
    frequencies = pixels_per_degree / 2 * np.append(1, BAND_FREQUENCY * 0.5 ** np.arange(14))
    low = np.flatnonzero(frequencies <= LEAST_FREQUENCY)
    bands = min(int(low[0]) + 1 if low.size else most + 1, most)
    return np.append(frequencies[:bands], BASE_FREQUENCY)


def halved(level: Plane) -> Plane:
    """Return the next level of (channels, H, W).

    Examples
    --------
    >>> halved(np.ones((1, 6, 8), np.float32)).shape
    (1, 3, 4)
    """
    channels, height, width = level.shape
    out = np.empty((channels, (height + 1) // 2, (width + 1) // 2), np.float32)
    by_rows(_halve, out.shape, level, out)
    return out


def expanded(level: Plane, shape: tuple[int, int]) -> Plane:
    """Return one plane at the size of the level before.

    Examples
    --------
    >>> expanded(np.ones((3, 4), np.float32), (6, 7)).shape
    (6, 7)
    """
    out = np.empty(shape, np.float32)
    by_rows(_expand, shape, level, out)
    return out


@entry_point
def _halve(first: int, last: int, level: Plane, out: Plane) -> None:
    channels, height, width = level.shape
    row = np.empty(width, np.float32)
    for channel in range(channels):
        plane = level[channel]
        for y in range(first, last):
            _add_up(
                plane[_mirrored(2 * y - 2, height)],
                plane[_mirrored(2 * y - 1, height)],
                plane[2 * y],
                plane[_mirrored(2 * y + 1, height)],
                plane[_mirrored(2 * y + 2, height)],
                row,
            )
            _halve_row(row, height % 2 == 1, out[channel, y])


@kernel
def _mirrored(index: int, size: int) -> int:
    if index < 0:
        return -1 - index
    return 2 * size - 1 - index if index >= size else index


@kernel
def _add_up(
    far_above: Plane, above: Plane, here: Plane, below: Plane, far_below: Plane, out: Plane
) -> None:
    for x in range(out.size):
        far, near = far_above[x] + far_below[x], above[x] + below[x]
        out[x] = far * _FAR + near * _NEAR + here[x] * _CENTRE


@kernel
def _halve_row(row: Plane, odd_rows: bool, out: Plane) -> None:
    width, last = row.size, out.size - 1
    inside = max((width - 3) // 2, 0)  # outputs 1 to this one have all taps
    a, b, c, d, e = row, row[1:], row[2:], row[3:], row[4:]
    inner = out[1:]
    for x in range(inside):
        i = 2 * x
        inner[x] = (a[i] + e[i]) * _FAR + (b[i] + d[i]) * _NEAR + c[i] * _CENTRE
    for x in range(inside + 1, last + 1):
        value = row[2 * x] * _CENTRE + row[2 * x - 1] * _NEAR + row[2 * x - 2] * _FAR
        if 2 * x + 1 < width:
            value += row[2 * x + 1] * _NEAR
        if 2 * x + 2 < width:
            value += row[2 * x + 2] * _FAR
        out[x] = value
    value = row[0] * (_CENTRE + _NEAR) + row[1] * (_NEAR + _FAR)
    if width > 2:
        value += row[2] * _FAR
    out[0] = value
    # The authors choose the mirrored taps of the last column by whether the number of rows is odd.
    if odd_rows:
        out[last] += row[width - 1] * _NEAR + row[width - 2] * _FAR
    else:
        out[last] += row[width - 1] * _FAR


@entry_point
def _expand(first: int, last: int, level: Plane, out: Plane) -> None:
    row = np.empty(level.shape[1], np.float32)
    for y in range(first, last):
        expand_row(level, y, row, out[y])


@kernel
def expand_row(level: Plane, y: int, row: Plane, out: Plane) -> None:
    """Write row y of the expanded plane; `row` is scratch space as wide as `level`.

    Even pixels are 0.1 x[j-1] + 0.8 x[j] + 0.1 x[j+1], odd ones 0.5 x[j] + 0.5 x[j+1], along both
    axes, with the border's pixels repeated.
    """
    j, last = y // 2, level.shape[0] - 1
    here, below = level[j], level[min(j + 1, last)]
    if y % 2 == 0:
        above = level[max(j - 1, 0)]
        for x in range(row.size):
            row[x] = _TWICE_FAR * (above[x] + below[x]) + _TWICE_CENTRE * here[x]
    else:
        for x in range(row.size):
            row[x] = _TWICE_NEAR * (here[x] + below[x])
    end = row.size - 1
    middle, right = row[1:], row[2:]
    inner = out[2:]
    for x in range(end - 1):
        inner[2 * x] = _TWICE_FAR * (row[x] + right[x]) + _TWICE_CENTRE * middle[x]
        inner[2 * x + 1] = _TWICE_NEAR * (middle[x] + right[x])
    out[0] = _TWICE_FAR * (row[0] + row[min(1, end)]) + _TWICE_CENTRE * row[0]
    out[1] = _TWICE_NEAR * (row[0] + row[min(1, end)])
    if end > 0:
        out[2 * end] = _TWICE_FAR * (row[end - 1] + row[end]) + _TWICE_CENTRE * row[end]
        if 2 * end + 1 < out.size:
            out[2 * end + 1] = _TWICE_NEAR * (row[end] + row[end])
