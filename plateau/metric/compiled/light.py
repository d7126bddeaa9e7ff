"""Radiance to luminance and colour: `plateau.metric.display` for a few pixels at a time."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.metric.compiled.arithmetic import bits_of, exp2, log2
from plateau.metric.compiled.jit import inlined
from plateau.metric.display import (
    LAB_A,
    LAB_B,
    LAB_EPSILON,
    LAB_KAPPA,
    LAB_OFFSET,
    LAB_SCALE,
    RGB_TO_XYZ,
    Plane,
    View,
)

_f = np.float32
_ZERO, _ONE, _THIRD = _f(0), _f(1), _f(1 / 3)
_INFINITY_BITS = np.int32(_f(np.inf).view(np.int32))
_ALL_BUT_SIGN = np.int32(0x7FFFFFFF)

_EPSILON = _f(LAB_EPSILON)
_SLOPE, _INTERCEPT = _f(LAB_KAPPA / LAB_SCALE), _f(LAB_OFFSET / LAB_SCALE)
_A, _B = _f(LAB_A), _f(LAB_B)

_Row = tuple[np.float32, np.float32, np.float32]


class KernelView(NamedTuple):
    """A view in the form of the kernels."""

    #: 2^EV; 1 if the view has a gamma, because numpy then applies the view beforehand.
    scale: np.float32
    #: cd/m².
    white_luminance: np.float32
    #: Linear RGB to CIE X, Y and Z.
    x: _Row
    y: _Row
    z: _Row
    #: One over X, Y and Z of white.
    per_white: _Row


def screen(view: View) -> KernelView:
    """Return a view in the form of the kernels."""
    matrix = RGB_TO_XYZ[view.primaries]
    x, y, z = (tuple(row) for row in matrix)
    per_white = tuple(_ONE / matrix.sum(axis=1, dtype=np.float32))
    scale = np.exp2(_f(view.exposure_ev)) if view.gamma == 1 else _ONE
    return KernelView(scale, _f(view.white_luminance), x, y, z, per_white)


@inlined
def show(
    pixels: Plane, scale: np.float32, red: Plane, green: Plane, blue: Plane, count: int
) -> bool:
    """Write the displayed RGB of interleaved pixels; return whether any pixel is not finite."""
    # Bits without the sign have the order of the magnitudes; infinity and NaN are the greatest.
    greatest = np.int32(0)
    for i in range(count):
        r, g, b = pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]
        greatest = max(greatest, np.int32(bits_of(r) & _ALL_BUT_SIGN))
        greatest = max(greatest, np.int32(bits_of(g) & _ALL_BUT_SIGN))
        greatest = max(greatest, np.int32(bits_of(b) & _ALL_BUT_SIGN))
        red[i] = min(max(r, _ZERO) * scale, _ONE)
        green[i] = min(max(g, _ZERO) * scale, _ONE)
        blue[i] = min(max(b, _ZERO) * scale, _ONE)
    return bool(greatest >= _INFINITY_BITS)


@inlined
def blacken(
    pixels: Plane, red: Plane, green: Plane, blue: Plane, non_finite: NDArray[np.bool_], count: int
) -> int:
    """Blacken and mark the pixels that are not finite, and return how many there are."""
    found = 0
    for i in range(count):
        r, g, b = pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]
        if not (math.isfinite(r) and math.isfinite(g) and math.isfinite(b)):
            red[i], green[i], blue[i] = _ZERO, _ZERO, _ZERO
            non_finite[i] = True
            found += 1
    return found


@inlined
def luminance(
    red: Plane, green: Plane, blue: Plane, y: _Row, white: np.float32, out: Plane, count: int
) -> None:
    """Write the luminance in cd/m², to the same bits as `plateau.metric.display` and the metric."""
    r, g, b = y
    for i in range(count):
        out[i] = white * ((red[i] * r + green[i] * g) + blue[i] * b)


@inlined
def response(
    red: Plane,
    green: Plane,
    blue: Plane,
    row: _Row,
    per_white: np.float32,
    out: Plane,
    count: int,
) -> None:
    """Write CIELAB's response to X, Y or Z: a cube root, and a straight line in the dark."""
    r, g, b = row
    for i in range(count):
        ratio = ((red[i] * r + green[i] * g) + blue[i] * b) * per_white
        root = exp2(log2(ratio) * _THIRD)
        out[i] = root if ratio > _EPSILON else _SLOPE * ratio + _INTERCEPT


@inlined
def opponent(x: Plane, y: Plane, z: Plane, a: Plane, b: Plane, count: int) -> None:
    """Write CIELAB a* and b* from the three responses."""
    for i in range(count):
        a[i] = _A * (x[i] - y[i])
        b[i] = _B * (y[i] - z[i])
