"""Pictures of a judgement, for people to look at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from metric.display import Mask

#: Visible pixels are shown in this colour, on the image in dim grey.
_MARK = np.array([255, 140, 0], np.uint8)


def difference_picture(picture: NDArray[np.uint8], visible: Mask) -> NDArray[np.uint8]:
    """Return the map of visible pixels laid over a picture, (H, W, 3) uint8 sRGB.

    Parameters
    ----------
    picture
        (H, W, 3) uint8, of `metric.encode_srgb`.
    visible
        The map, (H, W).

    Examples
    --------
    >>> visible = np.array([[True, False]])
    >>> difference_picture(np.full((1, 2, 3), 255, np.uint8), visible).tolist()
    [[[255, 140, 0], [85, 85, 85]]]
    """
    red, green, blue = np.moveaxis(picture.astype(np.uint16), -1, 0)
    grey = ((red + green + blue) // 9).astype(np.uint8)  # a third of their mean
    marked: NDArray[np.uint8] = np.repeat(grey[..., np.newaxis], 3, axis=-1)
    marked[visible] = _MARK
    return marked
