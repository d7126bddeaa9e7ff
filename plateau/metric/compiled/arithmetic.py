"""log2 and 2^x in single precision, as arithmetic that a compiler can vectorise.

Both are minimax polynomials without calls, branches or tables. The exponent bits reduce any number
to the polynomial's range. Tests check the stated errors.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from plateau.metric.compiled.jit import inlined

_f = np.float32

# log2(1 + t) / t for t from √½ - 1 to √2 - 1.
_L0, _L1, _L2, _L3 = _f(1.4426949), _f(-0.72135246), _f(0.48093116), _f(-0.36026347)
_L4, _L5, _L6, _L7 = _f(0.2868689), _f(-0.24832289), _f(0.23570944), _f(-0.14973277)

# 2^t for t from -½ to ½.
_E0, _E1, _E2 = _f(1.0000001), _f(0.69314724), _f(0.24022107)
_E3, _E4, _E5 = _f(0.055502973), _f(0.009676036), _f(0.0013410004)

_ONE = _f(1)
_SQRT_HALF_BITS = np.int32(_f(math.sqrt(0.5)).view(np.int32))
_MANTISSA_BITS = np.int32(23)
_EXPONENT_BIAS = np.int32(127)

#: Adding 1.5·2^23 leaves no fraction bits: the last bits of the sum are the integer.
_ROUND = _f(1.5 * 2**23)
_ROUND_BITS = np.int32(_ROUND.view(np.int32))


def _fma(_context: Any, _a: Any, _b: Any, _c: Any) -> tuple[Any, Callable[..., Any]]:
    def generate(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.fma(*args)

    return types.float32(types.float32, types.float32, types.float32), generate


def _bits_of(_context: Any, _number: Any) -> tuple[Any, Callable[..., Any]]:
    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.int32))

    return types.int32(types.float32), generate


def _from_bits(_context: Any, _bits: Any) -> tuple[Any, Callable[..., Any]]:
    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.float32))

    return types.float32(types.int32), generate


#: a·b + c, rounded once.
fma: Callable[[np.float32, np.float32, np.float32], np.float32] = intrinsic(_fma)
#: The 32 bits of a number.
bits_of: Callable[[np.float32], np.int32] = intrinsic(_bits_of)
#: The number that has these 32 bits.
from_bits: Callable[[np.int32], np.float32] = intrinsic(_from_bits)


@inlined
def log2(x: np.float32) -> np.float32:
    """Return log2 of a positive, normal float32 within 2e-7 and half a unit in the last place.

    For 0 it returns some finite number.
    """
    bits = bits_of(x)
    # x = 2^exponent · (1 + t)
    exponent = np.int32(np.int32(bits - _SQRT_HALF_BITS) >> _MANTISSA_BITS)
    t = from_bits(np.int32(bits - np.int32(exponent << _MANTISSA_BITS))) - _ONE
    p = fma(_L7, t, _L6)
    p = fma(p, t, _L5)
    p = fma(p, t, _L4)
    p = fma(p, t, _L3)
    p = fma(p, t, _L2)
    p = fma(p, t, _L1)
    p = fma(p, t, _L0)
    return fma(p, t, _f(exponent))


@inlined
def exp2(x: np.float32) -> np.float32:
    """Return 2^x within 3e-7 of its value; x must lie between -126 and 126."""
    # 2^x = 2^whole · 2^t
    shifted = x + _ROUND
    whole = np.int32(bits_of(shifted) - _ROUND_BITS)
    t = x - (shifted - _ROUND)
    p = fma(_E5, t, _E4)
    p = fma(p, t, _E3)
    p = fma(p, t, _E2)
    p = fma(p, t, _E1)
    p = fma(p, t, _E0)
    power: np.float32 = p * from_bits(np.int32(np.int32(whole + _EXPONENT_BIAS) << _MANTISSA_BITS))
    return power
