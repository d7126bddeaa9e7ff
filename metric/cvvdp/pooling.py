"""From the differences in each channel and band to one number in JOD."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.cvvdp.parameters import (
    BAND_EXPONENT,
    BASE_WEIGHTS,
    CHANNEL_EXPONENT,
    EPSILON,
    JOD_EXPONENT,
    JOD_SCALE,
    LINEAR_BELOW,
    STILL_WEIGHT,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


def raised(x: ArrayLike, exponent: float) -> Array:
    """Return (x + ε)^p - ε^p with ε = 1e-5, a power of finite slope at 0.

    Examples
    --------
    >>> float(raised(0, 0.5))
    0.0
    """
    power: Array = (np.asarray(x, np.float64) + EPSILON) ** exponent - EPSILON**exponent
    return power


def norm(x: ArrayLike, exponent: float, axis: int) -> Array:
    """Return the sum of powers along an axis, raised to 1/p.

    Examples
    --------
    >>> round(float(norm([3, 4], 2, 0)), 3)
    4.997
    """
    return raised(raised(x, exponent).sum(axis=axis), 1 / exponent)


def quality(differences: ArrayLike) -> float:
    """Return JOD from the pooled difference of each channel and band, (channels, bands).

    The base band comes last.

    Notes
    -----
    Q = 0.578 ‖ ‖w D‖₄ over bands ‖₄ over channels, with w = 1 but for the base band.

    Examples
    --------
    >>> quality(np.zeros((3, 5)))
    10.0
    """
    weighted = np.array(differences, np.float64)
    weighted[:, -1] *= BASE_WEIGHTS
    of_channels = norm(weighted, BAND_EXPONENT, axis=1)
    return float(jod(STILL_WEIGHT * norm(of_channels, CHANNEL_EXPONENT, axis=0)))


def jod(difference: ArrayLike) -> Array:
    """Return 10 - a Q^b for a pooled difference Q of 0 or more; below 0.1 a line through 10.

    Examples
    --------
    >>> jod([0.0, 0.1, 10.0]).round(3).tolist()
    [10.0, 9.995, 9.626]
    """
    q = np.asarray(difference, np.float64)
    line = JOD_SCALE * LINEAR_BELOW ** (JOD_EXPONENT - 1) * q
    curve = JOD_SCALE * np.maximum(q, LINEAR_BELOW) ** JOD_EXPONENT
    return np.where(q <= LINEAR_BELOW, 10 - line, 10 - curve)
