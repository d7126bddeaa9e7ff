"""Pixels to the light of a display, and to opponent colour."""

from __future__ import annotations

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

# IEC 61966-2-1: where the line ends, its slope, and the curve ((v + offset) / (1 + offset))^2.4.
_SRGB_FROM, _SRGB_SLOPE = _f(0.04045), _f(1 / 12.92)
_SRGB_OFFSET, _SRGB_SCALE, _SRGB_GAMMA = _f(0.055), _f(1 / 1.055), _f(2.4)


class KernelDisplay(NamedTuple):
    """A display as numbers for the kernels."""

    is_srgb: bool
    exposure: np.float32
    #: The range of the light that it emits in cd/m², without what it reflects.
    least: np.float32
    greatest: np.float32
    reflected: np.float32
    rgb_to_dkl: NDArray[np.float32]


def screen(display: Display) -> KernelDisplay:
    """Return the display as numbers."""
    return KernelDisplay(
        display.transfer == "srgb",
        _f(display.exposure),
        _f(display.black),
        _f(display.peak),
        _f(display.reflected),
        display.rgb_to_dkl,
    )


@inlined
def power(x: np.float32, exponent: np.float32) -> np.float32:
    """Return x^exponent for x of 0 or more, nearly 0 where it is below 2^-126."""
    result: np.float32 = exp2(min(max(exponent * log2(x), _LEAST_LOG2), _GREATEST_LOG2))
    return result


@entry_point
def opponent(
    first: int, last: int, image: NDArray[np.float32], screen: KernelDisplay, out: Plane
) -> None:
    """Write rows first … last − 1: the opponent colour of the light that is shown, in cd/m².

    `image` is (H, 3 W), interleaved, `out` (3, H, W). Relative light v is shown as
    L = (peak - black) clip(v exposure, 0, 1) + black + reflected.
    """
    work = np.empty((3, out.shape[2]), np.float32)
    red, green, blue = work[0], work[1], work[2]
    for y in range(first, last):
        _split(image[y], red, green, blue)
        for channel in range(3):
            if screen.is_srgb:
                _srgb(work[channel])
            _emit(work[channel], screen)
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
def _emit(row: Plane, screen: KernelDisplay) -> None:
    exposure, range_ = screen.exposure, screen.greatest - screen.least
    lowest = screen.least + screen.reflected
    for x in range(row.size):
        row[x] = range_ * min(max(row[x] * exposure, _ZERO), _ONE) + lowest


@kernel
def _mix(
    red: Plane, green: Plane, blue: Plane, r: np.float32, g: np.float32, b: np.float32, out: Plane
) -> None:
    for x in range(out.size):
        out[x] = r * red[x] + g * green[x] + b * blue[x]
