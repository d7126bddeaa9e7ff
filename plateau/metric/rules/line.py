"""The least-squares line through the last points of a curve."""

from collections.abc import Sequence


def least_squares_slope(points: Sequence[tuple[float, float]]) -> float:
    """Return the slope of the least-squares line through (x, y) points, in float64.

    Examples
    --------
    >>> least_squares_slope([(100, 10), (200, 30), (300, 20)])
    0.05
    """
    import numpy as np

    x, y = np.asarray(points, dtype=np.float64).T
    x -= x.mean()
    return float(x @ (y - y.mean()) / (x @ x))


def power_law_at_the_end(points: Sequence[tuple[int, float]]) -> float:
    """Return the power law through (spp, count) points, evaluated at the last of them.

    It is the line through the logarithms of spp and of count + ½, so counts may be 0.

    Examples
    --------
    >>> round(power_law_at_the_end([(100, 399.5), (200, 99.5), (400, 24.5)]), 3)
    24.5
    """
    import numpy as np

    logarithms = [(np.log(spp), np.log(count + 0.5)) for spp, count in points]
    x, y = np.mean(logarithms, axis=0)
    return float(np.exp(y + least_squares_slope(logarithms) * (logarithms[-1][0] - x)) - 0.5)
