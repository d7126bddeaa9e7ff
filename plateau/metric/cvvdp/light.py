"""Pixels to the light of a display, and to opponent colour."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from plateau.metric.compiled.arithmetic import exp2, log2
from plateau.metric.compiled.jit import entry_point, inlined, kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.cvvdp.display import Display
    from plateau.metric.display import Plane

_f = np.float32
_ZERO, _ONE = _f(0), _f(1)
_LEAST_LOG2, _GREATEST_LOG2 = _f(-126), _f(126)
_SRGB, _PQ, _HLG, _RELATIVE, _ABSOLUTE = range(5)
_NUMBERS = {"srgb": _SRGB, "pq": _PQ, "hlg": _HLG, "relative": _RELATIVE, "absolute": _ABSOLUTE}

# IEC 61966-2-1: where the line ends, its slope, and the curve ((v + offset) / (1 + offset))^2.4.
_SRGB_FROM, _SRGB_SLOPE = _f(0.04045), _f(1 / 12.92)
_SRGB_OFFSET, _SRGB_SCALE, _SRGB_GAMMA = _f(0.055), _f(1 / 1.055), _f(2.4)

# SMPTE ST 2084.
_PQ_PEAK, _PQ_N, _PQ_M = _f(10000), _f(1 / 0.1593017578125), _f(1 / 78.84375)
_PQ_C1, _PQ_C2, _PQ_C3 = _f(0.8359375), _f(18.8515625), _f(18.6875)
#: PQ and absolute light are shown at no less than this, in cd/m².
_LEAST_LIGHT = 0.005

# ITU-R BT.2100.
_A = 0.17883277
_B = 1 - 4 * _A
_HLG_PER_A, _HLG_B = _f(math.log2(math.e) / _A), _f(_B)
_HLG_C = _f(0.5 - _A * math.log(4 * _A))
_HLG_HALF, _THIRD, _TWELFTH = _f(0.5), _f(1 / 3), _f(1 / 12)
_HLG_RED, _HLG_GREEN, _HLG_BLUE = _f(0.2627), _f(0.6780), _f(0.0593)


class KernelDisplay(NamedTuple):
    """A display as numbers for the kernels."""

    transfer: int
    exposure: np.float32
    #: The range of the light that it emits in cd/m², without what it reflects.
    least: np.float32
    greatest: np.float32
    reflected: np.float32
    hlg_exponent: np.float32
    rgb_to_dkl: NDArray[np.float32]


def screen(display: Display) -> KernelDisplay:
    """Return the display as numbers."""
    black = display.black
    if display.transfer == "absolute":
        least, reflected = max(_LEAST_LIGHT, black), display.reflected
    elif display.transfer == "pq":
        least, reflected = _LEAST_LIGHT, black + display.reflected
    else:
        least, reflected = black, display.reflected
    return KernelDisplay(
        _NUMBERS[display.transfer],
        _f(display.exposure),
        _f(least),
        _f(display.peak),
        _f(reflected),
        _f(display.hlg_gamma - 1),
        display.rgb_to_dkl,
    )


@inlined
def power(x: np.float32, exponent: np.float32) -> np.float32:
    """Return x^exponent for x of 0 or more, nearly 0 where it is below 2^-126."""
    result: np.float32 = exp2(min(max(exponent * log2(x), _LEAST_LOG2), _GREATEST_LOG2))
    return result


@entry_point
def opponent(
    image: NDArray[np.float32], screen: KernelDisplay, first: int, end: int, out: Plane
) -> None:
    """Write some rows of the opponent colour of the light that the screen shows, in cd/m².

    `image` is (H, 3 W), interleaved, `out` (3, H, W). Relative light v is shown as
    L = (peak - black) clip(v exposure, 0, 1) + black + reflected; PQ and absolute light are
    multiplied by the exposure, clipped to the display's range, and lightened likewise.
    """
    work = np.empty((3, out.shape[2]), np.float32)
    red, green, blue = work[0], work[1], work[2]
    for y in range(first, end):
        _split(image[y], red, green, blue)
        if screen.transfer == _SRGB:
            for channel in range(3):
                _srgb(work[channel])
        elif screen.transfer == _PQ:
            for channel in range(3):
                _pq(work[channel])
        elif screen.transfer == _HLG:
            for channel in range(3):
                _hlg(work[channel])
            _system_gamma(red, green, blue, screen.hlg_exponent)
        for channel in range(3):
            if screen.transfer in (_PQ, _ABSOLUTE):
                _emit_absolute(work[channel], screen)
            else:
                _emit_relative(work[channel], screen)
        for channel in range(3):
            row = screen.rgb_to_dkl[channel]
            _mix(red, green, blue, row[0], row[1], row[2], out[channel, y])


@kernel
def _split(pixels: Plane, red: Plane, green: Plane, blue: Plane) -> None:
    for x in range(red.size):
        red[x], green[x], blue[x] = pixels[3 * x], pixels[3 * x + 1], pixels[3 * x + 2]


@kernel
def _srgb(row: Plane) -> None:
    for x in range(row.size):
        v = row[x]
        curve = power((v + _SRGB_OFFSET) * _SRGB_SCALE, _SRGB_GAMMA)
        row[x] = curve if v > _SRGB_FROM else v * _SRGB_SLOPE


@kernel
def _pq(row: Plane) -> None:
    for x in range(row.size):
        v = power(row[x], _PQ_M)
        row[x] = _PQ_PEAK * power(max(v - _PQ_C1, _ZERO) / (_PQ_C2 - _PQ_C3 * v), _PQ_N)


@kernel
def _hlg(row: Plane) -> None:
    for x in range(row.size):
        v = row[x]
        curve = (exp2((v - _HLG_C) * _HLG_PER_A) + _HLG_B) * _TWELFTH
        row[x] = v * v * _THIRD if v <= _HLG_HALF else curve


@kernel
def _system_gamma(red: Plane, green: Plane, blue: Plane, exponent: np.float32) -> None:
    for x in range(red.size):
        light = _HLG_RED * red[x] + _HLG_GREEN * green[x] + _HLG_BLUE * blue[x]
        factor = power(light, exponent)
        red[x] *= factor
        green[x] *= factor
        blue[x] *= factor


@kernel
def _emit_relative(row: Plane, screen: KernelDisplay) -> None:
    exposure, range_ = screen.exposure, screen.greatest - screen.least
    lowest = screen.least + screen.reflected
    for x in range(row.size):
        row[x] = range_ * min(max(row[x] * exposure, _ZERO), _ONE) + lowest


@kernel
def _emit_absolute(row: Plane, screen: KernelDisplay) -> None:
    exposure, least, greatest = screen.exposure, screen.least, screen.greatest
    reflected = screen.reflected
    for x in range(row.size):
        row[x] = min(max(row[x] * exposure, least), greatest) + reflected


@kernel
def _mix(
    red: Plane, green: Plane, blue: Plane, r: np.float32, g: np.float32, b: np.float32, out: Plane
) -> None:
    for x in range(out.size):
        out[x] = r * red[x] + g * green[x] + b * blue[x]
