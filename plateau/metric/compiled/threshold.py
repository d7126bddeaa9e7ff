"""The difference of two pixels in units of the smallest visible difference."""

import math

import numpy as np

from plateau.metric.compiled.arithmetic import exp2, fma, log2
from plateau.metric.compiled.jit import inlined
from plateau.metric.csf import (
    CONE_CURVE,
    CONE_CURVE_FROM,
    CONE_LINE,
    CONE_LINE_FROM,
    ROD_CONSTANT,
    ROD_CURVE,
    ROD_CURVE_FROM,
    ROD_LINE,
    ROD_LINE_FROM,
)
from plateau.metric.display import Plane
from plateau.metric.vdp import COLOUR_LUMINANCE, FLOOR

_f = np.float32
_ZERO, _HALF = _f(0), _f(0.5)
_FLOOR = _f(FLOOR)
_COLOUR_LUMINANCE = _f(COLOUR_LUMINANCE)
_LOG10_2, _LOG2_10 = _f(math.log10(2)), _f(math.log2(10))

#: In cd/m²: above it only the last three pieces of the threshold matter. It is slightly above their
#: border to allow for rounding.
_ROD_CURVE_UNDER = _f(1.001 * 10**ROD_LINE_FROM)

_R_SLOPE, _R_INTERCEPT, _R_POWER, _R_OFFSET = (_f(number) for number in ROD_CURVE)
_C_SLOPE, _C_INTERCEPT, _C_POWER, _C_OFFSET = (_f(number) for number in CONE_CURVE)
_ROD_CURVE_FROM, _ROD_LINE_FROM = _f(ROD_CURVE_FROM), _f(ROD_LINE_FROM)
_CONE_CURVE_FROM, _CONE_LINE_FROM = _f(CONE_CURVE_FROM), _f(CONE_LINE_FROM)
_ROD_CONSTANT, _ROD_LINE, _CONE_LINE = _f(ROD_CONSTANT), _f(ROD_LINE), _f(CONE_LINE)

# The same in powers of two, as log2 of one over the threshold at log2 of the luminance.
_CONE_CURVE_FROM_2 = _f(CONE_CURVE_FROM * math.log2(10))
_CONE_LINE_FROM_2 = _f(CONE_LINE_FROM * math.log2(10))
_ROD_LINE_2, _CONE_LINE_2 = _f(-ROD_LINE * math.log2(10)), _f(-CONE_LINE * math.log2(10))
# The cones' curve, a minimax polynomial (within 2e-7) about the middle of its range.
_MIDDLE = _f(3.125)
_P0, _P1, _P2 = _f(0.0087650977), _f(-0.54542059), _f(-0.039299972)
_P3, _P4, _P5 = _f(-0.00077731325), _f(4.9971550e-06), _f(-1.1188816e-07)


@inlined
def adaptation(ours: Plane, theirs: Plane, out: Plane, count: int) -> None:
    """Write the luminance to which the eye is adapted, in cd/m²."""
    for i in range(count):
        out[i] = max((ours[i] + theirs[i]) * _HALF, _FLOOR)


@inlined
def per_threshold(adapted: Plane, out: Plane, count: int) -> None:
    """Write the inverse of the luminance threshold (threshold versus intensity), in m²/cd."""
    dark = np.int32(0)
    for i in range(count):
        dark = np.int32(dark + np.int32(adapted[i] < _ROD_CURVE_UNDER))
    if dark > 0:
        _by_every_piece(adapted, out, count)
    else:
        _by_the_brighter_pieces(adapted, out, count)


@inlined
def luminance_strength(
    ours: Plane, theirs: Plane, per_threshold: Plane, out: Plane, count: int
) -> None:
    """Write the difference in luminance, in thresholds."""
    for i in range(count):
        out[i] = abs(ours[i] - theirs[i]) * per_threshold[i]


@inlined
def add_colour(
    our_a: Plane,
    our_b: Plane,
    their_a: Plane,
    their_b: Plane,
    adapted: Plane,
    strength: Plane,
    count: int,
) -> None:
    """Raise the strength to the squared distance in (a*, b*) where colour is visible."""
    for i in range(count):
        a, b = our_a[i] - their_a[i], our_b[i] - their_b[i]
        squared = a * a + b * b if adapted[i] >= _COLOUR_LUMINANCE else _ZERO
        strength[i] = max(strength[i], squared)


@inlined
def _by_every_piece(adapted: Plane, out: Plane, count: int) -> None:
    for i in range(count):
        g = log2(adapted[i]) * _LOG10_2
        # Both curves are (slope g + intercept)^power + offset, so one power serves both.
        rods = g < _ROD_LINE_FROM
        slope = _R_SLOPE if rods else _C_SLOPE
        intercept = _R_INTERCEPT if rods else _C_INTERCEPT
        power = _R_POWER if rods else _C_POWER
        offset = _R_OFFSET if rods else _C_OFFSET
        base = max(slope * g + intercept, _FLOOR)
        r = exp2(power * log2(base)) + offset
        r = g + _ROD_LINE if (g >= _ROD_LINE_FROM) & (g < _CONE_CURVE_FROM) else r
        r = g + _CONE_LINE if g >= _CONE_LINE_FROM else r
        r = _ROD_CONSTANT if g < _ROD_CURVE_FROM else r
        out[i] = exp2(-r * _LOG2_10)


@inlined
def _by_the_brighter_pieces(adapted: Plane, out: Plane, count: int) -> None:
    for i in range(count):
        light = log2(adapted[i])
        t = light - _MIDDLE
        p = fma(_P5, t, _P4)
        p = fma(p, t, _P3)
        p = fma(p, t, _P2)
        p = fma(p, t, _P1)
        p = fma(p, t, _P0)
        p = _ROD_LINE_2 - light if light < _CONE_CURVE_FROM_2 else p
        p = _CONE_LINE_2 - light if light >= _CONE_LINE_FROM_2 else p
        out[i] = exp2(p)
