"""The files of a set of results: what a merged image looks like, and what is marked on it.

They depend on nothing but the image, so that one that was spoiled can be made again to the byte.
"""

import numpy as np

from plateau.farm.images.exr import Pixels, encode_image
from plateau.farm.images.png import encode_png
from plateau.metric import MAP_PALETTE, Mask, difference_map, encode_srgb
from plateau.service.judging.broken_image import non_finite_png
from plateau.service.judging.thumbnails import thumbnail


def result_files(
    image: Pixels,
    visible: Mask | None,
    *,
    job_id: str,
    spp: int,
    exposure_ev: float,
    compressed: bool,
) -> dict[str, bytes]:
    """The files by name.

    Parameters
    ----------
    image
        (height, width, 3) float32 linear radiance.
    visible
        Where it differs visibly from the first image of the curve, (height, width) bool; None
        where there is none yet.
    job_id, spp
        Whose image it is, of how many samples per pixel.
    exposure_ev
        In stops, as the job's view has it.
    compressed
        Whether the EXR is, which takes a while.
    """
    about: dict[str, str | int] = {"plateau:job": job_id, "plateau:spp": spp}
    picture = encode_srgb(image, exposure_ev)
    files = {
        "image.exr": encode_image(image, about, compressed=compressed),
        "image.png": encode_png(picture),
        "thumbnail.png": encode_png(thumbnail(image, exposure_ev)),
    }
    if not np.isfinite(image).all():
        files["non-finite.png"] = non_finite_png(image, exposure_ev)
    if visible is not None:
        files["difference.png"] = encode_png(difference_map(picture, visible), MAP_PALETTE)
    return files
