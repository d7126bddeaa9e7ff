"""From the differences in each channel and band to one number in JOD."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plateau.metric.cvvdp.parameters import (
    BAND_EXPONENT,
    BASE_WEIGHTS,
    CHANNEL_EXPONENT,
    CHANNEL_WEIGHTS,
    COLOURS,
    EPSILON,
    FRAME_EXPONENT,
    GREATEST_DIFFERENCE,
    JOD_EXPONENT,
    JOD_SCALE,
    LINEAR_BELOW,
    STILL_WEIGHT,
)

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


def shares_by_zone(means: Array) -> Array:
    """Return what each zone has of Q⁴, and what more samples would take away: (2, rows, columns).

    Parameters
    ----------
    means
        Sums of D² and D³ over each zone, over the pixels of the band: (channels, bands, rows,
        columns, 2), without the base band, which has less than a thousandth of Q⁴.

    Notes
    -----
    Up to the still's weight, Q⁴ is Σ w⁴ M² over bands and channels, with M the mean of D² over a
    band's pixels. A zone z has L_z = Σ w⁴ M ⟨D²⟩_z of it, where ⟨D²⟩_z is the zone's part of M.

    Noise that is t times as strong makes D/(1 − D/g) t^p times as large, with g the greatest
    difference. So with n_z samples per pixel n_z ∂Q⁴/∂n_z = −2p G_z with
    G_z = Σ w⁴ M ⟨D² − D³/g⟩_z.

    Examples
    --------
    >>> shares_by_zone(np.array([[[[[2.0, 0.0], [1.0, 0.0]]]]])).tolist()
    [[[6.0, 3.0]], [[6.0, 3.0]]]
    """
    weights = np.array(CHANNEL_WEIGHTS[: len(means)]) ** CHANNEL_EXPONENT
    scale = weights[:, np.newaxis] * means[..., 0].sum(axis=(2, 3))
    squares, cubes = np.einsum("cb,cbyxp->pyx", scale, means)
    return np.stack([squares, squares - cubes / 10**GREATEST_DIFFERENCE])


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
