"""Differences between two images in one band: contrast, sensitivity, masking.

The background L of a pixel is its luminance at the next level, expanded. Its contrast in a channel
is C = (level - expanded) / L, at most 1000. With the sensitivity S at the reference's L and gains g
it becomes C' = g S C. Differences Δ = |C'test - C'reference| are masked by what both images have,
m = k blur(min(|C'test|, |C'reference|)), of every channel: D = Δ^p / (1 + Σ w m^q), and then
D / (1 + D / Dmax).
"""

import math

import numpy as np
from numpy.typing import NDArray

from plateau.metric.compiled.arithmetic import exp2, log2
from plateau.metric.compiled.jit import entry_point, inlined, kernel
from plateau.metric.cvvdp.light import power
from plateau.metric.cvvdp.parameters import (
    CHANNEL_EXPONENT,
    CROSS_CHANNEL,
    DIFFERENCE_EXPONENT,
    EPSILON,
    GAIN,
    GREATEST_CONTRAST,
    GREATEST_DIFFERENCE,
    LEAST_BACKGROUND,
    MASKING_EXPONENTS,
    MASKING_GAIN,
    MASKING_SIGMA,
)
from plateau.metric.cvvdp.pyramid import expand_row
from plateau.metric.cvvdp.sensitivity import log_luminances
from plateau.metric.display import Plane

_f = np.float32
_ZERO, _ONE = _f(0), _f(1)
_EPSILON = _f(EPSILON)
_LEAST, _MOST = _f(LEAST_BACKGROUND), _f(GREATEST_CONTRAST)
_LOG_FIRST, _LOG_LAST = (_f(bound) for bound in log_luminances())
_GAINS = np.array(GAIN, np.float32)

_REACH = 2 * MASKING_SIGMA
_GAUSSIAN = np.exp(-0.5 * (np.arange(_REACH + 1) / MASKING_SIGMA) ** 2)
#: Taps of the masker's blur, from the centre outwards.
_TAPS = np.asarray(_GAUSSIAN / (2 * _GAUSSIAN.sum() - 1), np.float32)

_P, _EPSILON_P = _f(DIFFERENCE_EXPONENT), _f(EPSILON**DIFFERENCE_EXPONENT)
_Q = np.array(MASKING_EXPONENTS, np.float32)
_EPSILON_Q = np.asarray(EPSILON ** np.array(MASKING_EXPONENTS), np.float32)
_WEIGHTS = np.asarray(2.0 ** np.array(CROSS_CHANNEL), np.float32)
_MASKING_GAIN = _f(10**MASKING_GAIN)
_GREATEST = _f(10**GREATEST_DIFFERENCE)
_EPSILON_4, _EPSILON_ROOT = _f(EPSILON**CHANNEL_EXPONENT), _f(EPSILON ** (1 / CHANNEL_EXPONENT))


@entry_point
def contrasts(
    first: int,
    last: int,
    reference: Plane,
    coarse_reference: Plane,
    test: Plane,
    coarse_test: Plane,
    table: Plane,
    scale: np.float32,
    differences: Plane,
    common: Plane,
) -> None:
    """Write Δ and the smaller contrast of a band's rows first … last − 1, each (channels, H, W).

    Channels are the three of a still, or the four of a video. `table` is from `log_sensitivities`;
    contrasts are multiplied by `scale`. The smaller contrast is blurred along the rows if the band
    is larger than the blur.
    """
    channels, height, width = reference.shape
    blurred = min(height, width) > _REACH
    coarse_row = np.empty(coarse_reference.shape[2], np.float32)
    ours, theirs = np.empty((channels, width), np.float32), np.empty((channels, width), np.float32)
    work = np.empty((3, width), np.float32)
    our_light, their_light, row = work[0], work[1], work[2]
    padded = np.empty(width + 2 * _REACH, np.float32)
    place, sensitivity = np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(first, last):
        for channel in range(channels):
            expand_row(coarse_reference[channel], y, coarse_row, ours[channel])
            expand_row(coarse_test[channel], y, coarse_row, theirs[channel])
        _place(ours[0], _f(table.shape[1] - 1), place)
        _per_light(ours[0], scale, our_light)
        _per_light(theirs[0], scale, their_light)
        most = scale * _MOST
        for channel in range(channels):
            _sensitivity(place, table[channel], _GAINS[channel], sensitivity)
            _difference(
                reference[channel, y],
                ours[channel],
                our_light,
                test[channel, y],
                theirs[channel],
                their_light,
                sensitivity,
                most,
                differences[channel, y],
                row,
            )
            if blurred:
                _blur_row(row, padded, common[channel, y])
            else:
                common[channel, y] = row


@kernel
def _place(light: Plane, last: np.float32, out: Plane) -> None:
    per_log = last / (_LOG_LAST - _LOG_FIRST)
    for x in range(out.size):
        out[x] = min(max((log2(max(light[x], _LEAST)) - _LOG_FIRST) * per_log, _ZERO), last)


@kernel
def _per_light(light: Plane, scale: np.float32, out: Plane) -> None:
    for x in range(out.size):
        out[x] = scale / max(light[x], _LEAST)


@kernel
def _sensitivity(place: Plane, table: Plane, gain: np.float32, out: Plane) -> None:
    end = np.int32(table.size - 2)
    for x in range(out.size):
        i = min(np.int32(place[x]), end)
        low = table[i]
        out[x] = low + (place[x] - _f(i)) * (table[i + 1] - low)
    for x in range(out.size):
        out[x] = gain * exp2(out[x])


@kernel
def _difference(
    reference: Plane,
    coarse_reference: Plane,
    our_light: Plane,
    test: Plane,
    coarse_test: Plane,
    their_light: Plane,
    sensitivity: Plane,
    most: np.float32,
    difference: Plane,
    common: Plane,
) -> None:
    for x in range(difference.size):
        s = sensitivity[x]
        ours = s * min((reference[x] - coarse_reference[x]) * our_light[x], most)
        theirs = s * min((test[x] - coarse_test[x]) * their_light[x], most)
        difference[x] = abs(theirs - ours)
        common[x] = min(abs(theirs), abs(ours))


@kernel
def _blur_row(row: Plane, padded: Plane, out: Plane) -> None:
    width = row.size
    inside = padded[_REACH:]
    for x in range(width):
        inside[x] = row[x]
    for i in range(1, _REACH + 1):
        padded[_REACH - i] = row[i]
        padded[_REACH + width - 1 + i] = row[width - 1 - i]
    _weigh(inside, _TAPS[0], out)
    for i in range(1, _REACH + 1):
        _add_weighed(padded[_REACH - i :], padded[_REACH + i :], _TAPS[i], out)


@kernel
def _weigh(row: Plane, tap: np.float32, out: Plane) -> None:
    for x in range(out.size):
        out[x] = row[x] * tap


@kernel
def _add_weighed(one: Plane, other: Plane, tap: np.float32, out: Plane) -> None:
    for x in range(out.size):
        out[x] += (one[x] + other[x]) * tap


@entry_point
def masked(
    first: int,
    last: int,
    differences: Plane,
    common: Plane,
    weights: NDArray[np.float32],
    sums: NDArray[np.float64],
    strength: Plane,
) -> None:
    """Write the sums of D² + 2 ε D of rows first … last − 1 into `sums`, (channels, H) float64.

    `strength` receives the difference of all channels by their weights, (H, W), unless it is empty.
    """
    channels, height, width = differences.shape
    blurred = min(height, width) > _REACH
    raised = np.empty((channels, width), np.float32)
    mask = np.empty(width, np.float32)
    for y in range(first, last):
        for channel in range(channels):
            row, plane = raised[channel], common[channel]
            if blurred:
                _weigh(plane[y], _TAPS[0], row)
                for i in range(1, _REACH + 1):
                    above, below = abs(y - i), height - 1 - abs(height - 1 - y - i)
                    _add_weighed(plane[above], plane[below], _TAPS[i], row)
            else:
                _weigh(plane[y], _ONE, row)
            _raise(row, _Q[channel], _EPSILON_Q[channel])
        for channel in range(channels):
            mask[:] = _ONE
            for by in range(channels):
                add_scaled(raised[by], _WEIGHTS[by, channel], mask)
            row = differences[channel, y]
            _mask(row, mask)
            sums[channel, y] = _pooled(row)
        if strength.size > 0:
            strength[y] = _ZERO
            for channel in range(channels):
                _add_fourth(differences[channel, y], weights[channel], strength[y])
            _take_fourth_root(strength[y])


@entry_point
def powers_by_zone(
    differences: Plane, pixels_across: int, size: int, sums: NDArray[np.float64]
) -> None:
    """Add D² and D³ of every pixel to its zone's `sums`, (channels, rows, columns, 2) float64.

    A zone is a square of `size` pixels of the image, and a pixel of the band is `pixels_across` of
    them across. It lies in the zone of its first pixel of the image.
    """
    channels, height, width = differences.shape
    for channel in range(channels):
        for y in range(height):
            row = sums[channel, y * pixels_across // size]
            for x in range(width):
                d = np.float64(differences[channel, y, x])
                zone = row[x * pixels_across // size]
                zone[0] += d * d
                zone[1] += d * d * d


@inlined
def _shifted_power(x: np.float32, exponent: np.float32, offset: np.float32) -> np.float32:
    result: np.float32 = power(x + _EPSILON, exponent) - offset
    return result


@kernel
def _raise(row: Plane, exponent: np.float32, offset: np.float32) -> None:
    for x in range(row.size):
        row[x] = _shifted_power(row[x] * _MASKING_GAIN, exponent, offset)


@kernel
def add_scaled(row: Plane, weight: np.float32, out: Plane) -> None:
    """Add a row times its weight to another row."""
    for x in range(out.size):
        out[x] += row[x] * weight


@kernel
def _mask(row: Plane, mask: Plane) -> None:
    for x in range(row.size):
        strong = max(_shifted_power(row[x], _P, _EPSILON_P), _ZERO) / mask[x]
        row[x] = _GREATEST * strong / (_GREATEST + strong)


@kernel
def _pooled(row: Plane) -> float:
    total = 0.0
    for x in range(row.size):
        total += row[x] * (row[x] + _f(2) * _EPSILON)
    return total


@kernel
def _add_fourth(row: Plane, weight: np.float32, out: Plane) -> None:
    for x in range(out.size):
        v = weight * row[x] + _EPSILON
        out[x] += (v * v) * (v * v) - _EPSILON_4


@kernel
def _take_fourth_root(row: Plane) -> None:
    for x in range(row.size):
        row[x] = math.sqrt(math.sqrt(max(row[x], _ZERO) + _EPSILON)) - _EPSILON_ROOT
