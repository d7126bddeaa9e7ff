"""The pictures of a job that people look at."""

import numpy as np
from numpy.typing import NDArray

from farm.exr import Pixels
from metric import encode_srgb

#: Visible pixels are shown in this colour, on the image in dim grey.
_MARK = np.array([255, 140, 0], np.uint8)


def difference_picture(
    image: Pixels, visible: NDArray[np.bool_], exposure_ev: float
) -> NDArray[np.uint8]:
    """The visible-difference map over the image: (height, width, 3) uint8 sRGB."""
    grey = encode_srgb(image, exposure_ev).mean(axis=-1, keepdims=True) / 3
    picture = np.repeat(grey.astype(np.uint8), 3, axis=-1)
    picture[visible] = _MARK
    return picture
