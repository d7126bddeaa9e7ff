"""Pictures of a judgement, for people to look at."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from metric.display import encode_srgb

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from metric.display import Mask

#: Visible pixels are shown in this colour, on the image in dim grey.
_MARK = np.array([255, 140, 0], np.uint8)


def difference_picture(
    image: NDArray[Any], visible: Mask, exposure_ev: float = 0.0
) -> NDArray[np.uint8]:
    """Return the map of visible pixels laid over the image, (H, W, 3) uint8 sRGB.

    Parameters
    ----------
    image
        (H, W, 3), linear radiance.
    visible
        The map, (H, W).
    exposure_ev
        In stops, as in `encode_srgb`.

    Examples
    --------
    >>> visible = np.array([[True, False]])
    >>> difference_picture(np.ones((1, 2, 3)), visible).tolist()
    [[[255, 140, 0], [85, 85, 85]]]
    """
    grey = encode_srgb(image, exposure_ev).mean(axis=-1, keepdims=True) / 3
    picture = np.repeat(grey.astype(np.uint8), 3, axis=-1)
    picture[visible] = _MARK
    return picture
