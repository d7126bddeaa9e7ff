"""Where people look: weights of an image's pixels, by which visible ones are counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plateau.metric.display import Plane


def focus_plane(weights: Sequence[Sequence[float]], height: int, width: int) -> Plane:
    """Return the weight of each pixel, (height, width) float32 with a mean of 1.

    Where nobody looks, a visible pixel counts for less than one. Since all weights are 1 on
    average, a share of the image means what it means without a focus.

    Parameters
    ----------
    weights
        Rows of 0 or more, all of the same length and not all 0. They are stretched over the image,
        each over a rectangle.
    height, width
        Of the image, in pixels.

    Raises
    ------
    ValueError
        If the rows differ in length, a weight is negative or not finite, or none that a pixel of
        the image has is above 0.

    Examples
    --------
    >>> focus_plane([[0, 3, 1]], 1, 6).tolist()
    [[0.0, 0.0, 2.25, 2.25, 0.75, 0.75]]
    """
    if not weights or len({len(row) for row in weights}) > 1 or not weights[0]:
        raise ValueError("the rows of a focus need weights, and all the same number of them")
    grid = np.asarray(weights, np.float64)
    if not np.isfinite(grid).all() or (grid < 0).any():
        raise ValueError("the weights of a focus are 0 or more")
    rows, columns = (
        np.arange(pixels) * cells // pixels
        for pixels, cells in zip((height, width), grid.shape, strict=True)
    )
    plane: Plane = grid[np.ix_(rows, columns)].astype(np.float32)
    mean = plane.mean(dtype=np.float64)
    if mean == 0:
        raise ValueError("no weight of the focus is above 0: nobody would look at any pixel")
    plane /= np.float32(mean)
    return plane
