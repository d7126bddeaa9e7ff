"""From the differences in each channel and band to one number in JOD."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.cvvdp.parameters import (
    BAND_EXPONENT,
    BASE_WEIGHTS,
    CHANNEL_EXPONENT,
    CHANNEL_WEIGHTS,
    COLOURS,
    EPSILON,
    FRAME_EXPONENT,
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


def pooled_difference(differences: ArrayLike) -> float:
    """Return Q from the pooled difference of each channel and band, (channels, bands).

    The base band comes last. Three channels are a still's, four those of a frame of a video.

    Notes
    -----
    Q = ‖ ‖w v D‖₄ over bands ‖₄ over channels, where v = 1 but for the base band, and w = 1 but for
    the transient channel, 0.81. A still's is multiplied by 0.578.

    Examples
    --------
    >>> pooled_difference(np.zeros((3, 5)))
    0.0
    """
    weighted = np.array(differences, np.float64)
    channels = len(weighted)
    weighted *= np.array(CHANNEL_WEIGHTS[:channels])[:, np.newaxis]
    weighted[:, -1] *= BASE_WEIGHTS[:channels]
    of_channels = norm(weighted, BAND_EXPONENT, axis=1)
    return viewing_weight(channels) * float(norm(of_channels, CHANNEL_EXPONENT, axis=0))


def viewing_weight(channels: int) -> float:
    """Return by what the difference of an image with this many channels is multiplied.

    Examples
    --------
    >>> round(viewing_weight(3), 3), viewing_weight(4)
    (0.578, 1.0)
    """
    return STILL_WEIGHT if channels == COLOURS else 1.0


def over_frames(differences: ArrayLike) -> float:
    """Return the Q of a video from that of each of its frames, (frames,): their quadratic mean.

    Examples
    --------
    >>> round(over_frames([1.0, 7.0]), 2)
    5.0
    """
    squares = raised(differences, FRAME_EXPONENT)
    return float(raised(squares.mean(), 1 / FRAME_EXPONENT))


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
