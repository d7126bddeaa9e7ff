"""The threshold elevation F of a pixel by its surroundings, computed only where it decides.

A difference of strength s is visible where s > F, and F is between 1 and 10. Let C be a band's
contrast and W its weight. Where 1 < s ≤ 10, neither the clamp nor the division matters: the
difference is visible where s·ΣC > ΣC W m. The masking m is at least 1, so s·ΣC ≤ ΣC W decides most
pixels without m.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.metric.compiled.arithmetic import exp2, log2
from plateau.metric.compiled.jit import inlined
from plateau.metric.csf import (
    A_LUMINANCE,
    A_POWER,
    A_SCALE,
    B_LUMINANCE,
    B_POWER,
    B_SCALE,
    MASKING_CONTRAST,
    MASKING_POWER,
    MASKING_SCALE,
    RISE,
)
from plateau.metric.display import Plane
from plateau.metric.vdp import BANDS, ELEVATION_MAX, ELEVATION_MIN, FLOOR, VisibleDifferences

_f = np.float32
_ONE = _f(1)
_FLOOR = _f(FLOOR)
_LEAST, _GREATEST = _f(ELEVATION_MIN), _f(ELEVATION_MAX)

_A_SQUARED, _A_LUMINANCE, _TWICE_A_POWER = _f(A_SCALE**2), _f(A_LUMINANCE), _f(2 * A_POWER)
_B_SCALE, _B_LUMINANCE, _B_POWER = _f(B_SCALE), _f(B_LUMINANCE), _f(B_POWER)
_RISE = _f(RISE)

# Masking in terms of u = x²: (MASKING_SCALE (MASKING_CONTRAST x)^p)^4 = factor · u^(2 p).
_MASKING_FACTOR = _f(MASKING_SCALE**4 * MASKING_CONTRAST ** (4 * MASKING_POWER))
_MASKING_POWER = _f(2 * MASKING_POWER)

#: Too small to change a result, and its square is still a normal number: arithmetic on subnormal
#: numbers takes a hundred times as long.
_TINY = _f(2**-60)
_LOG2_TINY = _f(-60)


class Eye(NamedTuple):
    """The eye's parameters for an image of some width."""

    #: The level with the luminance to which the eye adapts.
    adaptation_level: int
    #: W, the bands' weights, and the squares of their frequencies in cycles²/degree².
    weights: NDArray[np.float32]
    squared_frequencies: NDArray[np.float32]
    #: The exponent of the coarsest band's e^(-b c), in powers of two and for b = 1.
    decay_rate: np.float32


def eye(metric: VisibleDifferences, width: int) -> Eye:
    """Return the eye's parameters for an image of this width."""
    frequencies = metric.frequencies_cpd(width)
    coarsest = float(frequencies[-1])
    return Eye(
        metric.adaptation_level(width),
        metric.band_weights(width),
        frequencies * frequencies,
        _f(-coarsest * math.log2(math.e)),
    )


@inlined
def contrast(
    our_fine: Plane,
    our_coarse: Plane,
    our_around: Plane,
    their_fine: Plane,
    their_coarse: Plane,
    their_around: Plane,
    out: Plane,
    count: int,
) -> None:
    """Write C, the greater of both images' contrasts in a band."""
    for i in range(count):
        detail = max(abs(our_fine[i] - our_coarse[i]), abs(their_fine[i] - their_coarse[i]))
        out[i] = detail / max(max(our_around[i], their_around[i]), _FLOOR)


@inlined
def total(
    c0: Plane, c1: Plane, c2: Plane, c3: Plane, c4: Plane, c5: Plane, out: Plane, count: int
) -> None:
    """Write ΣC, at least the floor."""
    for i in range(count):
        out[i] = max(c0[i] + c1[i] + c2[i] + c3[i] + c4[i] + c5[i], _FLOOR)


@inlined
def weighted_total(
    c0: Plane,
    c1: Plane,
    c2: Plane,
    c3: Plane,
    c4: Plane,
    c5: Plane,
    weights: NDArray[np.float32],
    out: Plane,
    count: int,
) -> None:
    """Write ΣC W."""
    w0, w1, w2 = weights[0], weights[1], weights[2]
    w3, w4, w5 = weights[3], weights[4], weights[5]
    for i in range(count):
        out[i] = c0[i] * w0 + c1[i] * w1 + c2[i] * w2 + c3[i] * w3 + c4[i] * w4 + c5[i] * w5


@inlined
def decide_by_range(strength: Plane, visible: NDArray[np.bool_], count: int) -> int:
    """Mark the pixels that no elevation can hide; return for how many the elevation decides."""
    open_ = np.int32(0)
    for i in range(count):
        s = strength[i]
        visible[i] = s > _GREATEST
        open_ = np.int32(open_ + np.int32((s > _LEAST) & (s <= _GREATEST)))
    return int(open_)


@inlined
def find_open(
    strength: Plane, contrasts: Plane, least: Plane, open_: NDArray[np.uint8], count: int
) -> None:
    """Write which pixels are still open: visible ones need s·ΣC > ΣC W."""
    for i in range(count):
        s = strength[i]
        open_[i] = (s > _LEAST) & (s <= _GREATEST) & (s * contrasts[i] > least[i])


@inlined
def sensitivity(adapted: Plane, rate: np.float32, scale: Plane, decay: Plane, count: int) -> None:
    """Write Barten's a² and, for the coarsest band, q = e^(-b c)."""
    for i in range(count):
        per_light = _ONE / adapted[i]
        scale[i] = _A_SQUARED * exp2(_TWICE_A_POWER * log2(_ONE + _A_LUMINANCE * per_light))
        slope = _B_SCALE * exp2(_B_POWER * log2(_ONE + _B_LUMINANCE * per_light))
        decay[i] = exp2(max(slope * rate, _LOG2_TINY))


@inlined
def add_masked(
    contrast: Plane,
    weight: np.float32,
    squared_frequency: np.float32,
    scale: Plane,
    decay: Plane,
    out: Plane,
    count: int,
) -> None:
    """Add a band's C W m, and replace q by that of the next finer band."""
    for i in range(count):
        q = decay[i]
        # csf² = (a c)² (q² + .06 q), and masking needs only the square of C·csf.
        squared = squared_frequency * scale[i] * (q * q + _RISE * q)
        u = max(contrast[i] * contrast[i] * squared, _TINY)
        masking = math.sqrt(math.sqrt(_ONE + _MASKING_FACTOR * exp2(_MASKING_POWER * log2(u))))
        out[i] += contrast[i] * weight * masking
        # Twice the frequency: the exponent doubles.
        decay[i] = max(q * q, _TINY)


@inlined
def decide(
    strength: Plane, contrasts: Plane, masked: Plane, out: NDArray[np.uint8], count: int
) -> None:
    """Write which of the open pixels are visible."""
    for i in range(count):
        out[i] = strength[i] * contrasts[i] > masked[i]


assert BANDS == 6, "the sums over bands are written out"
