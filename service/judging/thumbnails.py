"""Small pictures of images, for lists."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.exr import Pixels
from plateau.metric import encode_srgb

#: The longer side of a thumbnail has so many pixels at most.
LONGEST: Final = 192


def thumbnail(image: Pixels, exposure_ev: float) -> NDArray[np.uint8]:
    """A small (height, width, 3) uint8 sRGB picture of a linear image.

    Light is averaged before it is encoded, so that a thumbnail is as bright as its image; that a
    noisy image looks smooth in it is what any look from afar does.

    Parameters
    ----------
    image
        (height, width, 3) float32 linear radiance; what is not finite counts as black.
    exposure_ev
        In stops, as in `metric.encode_srgb`.
    """
    factor = -(-max(image.shape[:2]) // LONGEST)
    if factor > 1:
        image = _block_means(np.where(np.isfinite(image), image, 0), factor)
    return encode_srgb(image, exposure_ev)


def _block_means(image: NDArray[Any], factor: int) -> Pixels:
    """The means of blocks of factor × factor pixels; the last ones may be smaller."""
    for axis in (0, 1):
        starts = np.arange(0, image.shape[axis], factor)
        sizes = np.diff([*starts, image.shape[axis]])
        shape = [1, 1, 1]
        shape[axis] = -1
        image = np.add.reduceat(image, starts, axis=axis) / sizes.reshape(shape)
    return image.astype(np.float32)
