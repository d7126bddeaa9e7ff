"""Pictures of a judgement, for people to look at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from metric.display import Mask

#: Visible pixels are shown in this colour, on the image in dim grey.
_MARK = (255, 140, 0)
_MARK_CODE = 255
#: The colour of each code of a difference map, (256, 3) uint8.
DIFFERENCE_PALETTE = np.repeat(np.arange(256, dtype=np.uint8)[:, np.newaxis], 3, axis=1)
DIFFERENCE_PALETTE[_MARK_CODE] = _MARK


def difference_map(picture: NDArray[np.uint8], visible: Mask) -> NDArray[np.uint8]:
    """Return the map of visible pixels laid over a picture, (H, W) uint8.

    Its codes are those of `DIFFERENCE_PALETTE`, which makes it a picture.

    Parameters
    ----------
    picture
        (H, W, 3) uint8, of `metric.encode_srgb`.
    visible
        The map, (H, W).

    Examples
    --------
    >>> visible = np.array([[True, False]])
    >>> codes = difference_map(np.full((1, 2, 3), 255, np.uint8), visible)
    >>> DIFFERENCE_PALETTE[codes].tolist()
    [[[255, 140, 0], [85, 85, 85]]]
    """
    red, green, blue = np.moveaxis(picture.astype(np.uint16), -1, 0)
    # A third of their mean.
    codes: NDArray[np.uint8] = ((red + green + blue) // 9).astype(np.uint8)
    codes[visible] = _MARK_CODE
    return codes
