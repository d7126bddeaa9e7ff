"""Light of fireflies: a screen shows it as white, and the converged image has it around them."""

from typing import Final

import numpy as np

from plateau.metric.display import Image, View, as_image
from plateau.metric.noise_model import Half
from plateau.metric.quality import BLOCK
from plateau.metric.zone_noise import zone_sums

#: The least share of a block's light that anybody could see.
LEAST_SEEN: Final = 0.01


def hidden_light(halves: tuple[Half, Half], view: View) -> Image | None:
    """Return the light above white that one half lacks, as the mean of each block around it.

    Parameters
    ----------
    halves
        The even- and the odd-indexed slices. Pixels that are not finite have no such light.
    view
        The screen, and with it what is white.

    Notes
    -----
    A rare bright sample stands for the paths of its surroundings that were not found. A screen
    shows one white pixel in its place, and the image has less light than the converged one. The
    result is (H, W, 3) float32, or None where no block has a hundredth more by it, seen by nobody.

    Examples
    --------
    >>> from plateau.metric import Half, View
    >>> calm = np.full((64, 64, 3), 0.5, np.float32)
    >>> bright = calm.copy()
    >>> bright[7, 40] = 205.5
    >>> hidden_light((Half(calm, 50), Half(calm, 50)), View()) is None
    True
    >>> hidden_light((Half(bright, 50), Half(calm, 50)), View())[::32, ::32, 0].tolist()
    [[0.0, 0.099609375], [0.0, 0.0]]
    """
    one, other = (as_image(half.mean) for half in halves)
    share = halves[0].spp / (halves[0].spp + halves[1].spp)
    white = np.float32(view.brightest)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is left out
        image = other + np.float32(share) * (one - other)
        found = (image > white) & (np.minimum(one, other) < white) & np.isfinite(image)
    if not found.any():
        return None
    shown = np.clip(np.nan_to_num(image), 0, white)
    hidden, light = (
        np.stack([zone_sums(plane, BLOCK) for plane in np.moveaxis(planes, -1, 0)], axis=-1)
        for planes in (np.where(found, image - white, 0), shown)
    )
    if not (hidden > LEAST_SEEN * light).any():
        return None
    height, width = image.shape[:2]
    pixels = zone_sums(np.ones((height, width)), BLOCK)[..., np.newaxis]
    spread: Image = np.float32(hidden / pixels).repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
    return spread[:height, :width]
