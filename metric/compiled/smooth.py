"""The blur that `metric.denoise` spends its time in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from metric.compiled.jit import entry_point, kernel
from metric.pyramid import KERNEL

if TYPE_CHECKING:
    from metric.display import Plane

_CENTRE, _NEAR, _FAR = (np.float32(tap) for tap in KERNEL)


def smoothed(planes: Plane, gap: int) -> Plane:
    """Return what `metric.denoise.smoothed` does, to the bit."""
    stack = np.ascontiguousarray(planes).reshape(-1, *planes.shape[-2:])
    out = np.empty_like(stack)
    _smooth(stack, gap, np.empty(stack.shape[-1], np.float32), out)
    return out.reshape(planes.shape)


@entry_point
def _smooth(stack: Plane, gap: int, row: Plane, out: Plane) -> None:
    for number in range(stack.shape[0]):
        plane, height = stack[number], stack.shape[1]
        for y in range(height):
            last = height - 1
            _add_up(
                plane[y],
                plane[max(y - gap, 0)],
                plane[min(y + gap, last)],
                plane[max(y - 2 * gap, 0)],
                plane[min(y + 2 * gap, last)],
                row,
            )
            _along(row, gap, out[number, y])


@kernel
def _add_up(
    centre: Plane, above: Plane, below: Plane, far_above: Plane, far_below: Plane, out: Plane
) -> None:
    for x in range(out.size):
        value = centre[x] * _CENTRE
        value += (above[x] + below[x]) * _NEAR
        value += (far_above[x] + far_below[x]) * _FAR
        out[x] = value


@kernel
def _along(row: Plane, gap: int, out: Plane) -> None:
    last, reach = row.size - 1, 2 * gap
    for x in range(min(reach, row.size)):
        out[x] = _at_border(row, x, gap, last)
    # Neighbours by slices that start at 0, or the loop would not become vectors.
    inside = max(row.size - 2 * reach, 0)
    if inside > 0:
        _add_up(
            row[reach : reach + inside],
            row[reach - gap : reach - gap + inside],
            row[reach + gap : reach + gap + inside],
            row[:inside],
            row[2 * reach :],
            out[reach : reach + inside],
        )
    for x in range(max(row.size - reach, min(reach, row.size)), row.size):
        out[x] = _at_border(row, x, gap, last)


@kernel
def _at_border(row: Plane, x: int, gap: int, last: int) -> np.float32:
    value: np.float32 = row[x] * _CENTRE
    value += (row[max(x - gap, 0)] + row[min(x + gap, last)]) * _NEAR
    value += (row[max(x - 2 * gap, 0)] + row[min(x + 2 * gap, last)]) * _FAR
    return value
