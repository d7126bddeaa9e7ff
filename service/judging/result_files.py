"""The files of a set of results: what a merged image looks like, and what is marked on it.

They depend on nothing but the image, so that one that was spoiled can be made again to the byte.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plateau.farm.images.exr import Pixels, encode_layers
from plateau.farm.images.png import encode_png
from plateau.farm.model.spec import JobSpec
from plateau.metric import (
    MAP_PALETTE,
    Mask,
    allowed_non_finite,
    difference_map,
    encode_srgb,
    non_finite_map,
    non_finite_pixels,
)
from plateau.service.judging.facts import Facts, exr_header, png_texts
from plateau.service.judging.merge import Merge

#: The longer side of a thumbnail has so many pixels at most.
LONGEST: Final = 192

_CAUSES: Final = (
    "an emitter whose radiance is NaN or infinite, or a texture or a material that divides by zero"
)


def result_files(
    merge: Merge,
    visible: Mask | None,
    facts: Facts,
    spec: JobSpec,
    *,
    compressed: bool,
) -> dict[str, bytes]:
    """The files by name.

    Parameters
    ----------
    merge
        The image.
    visible
        Where it differs visibly from the first image of the curve, (height, width) bool; None
        where there is none yet.
    facts
        What the files say of themselves.
    spec
        The job's: how its EXR is written, and how bright its pictures are.
    compressed
        Whether the EXR is, as the spec says, which takes a while.
    """
    image, exposure_ev = merge.image(), spec.view.exposure_ev
    picture = encode_srgb(image, exposure_ev)
    files = {
        "image.exr": encode_layers(
            merge.layers(),
            exr_header(facts),
            precision=spec.exr.precision,
            compression=spec.exr.compression if compressed else "none",
            whole=("Z", *merge.channels.ids),
        ),
        "image.png": encode_png(picture, texts=png_texts(facts)),
        "thumbnail.png": encode_png(thumbnail(image, exposure_ev)),
    }
    if not np.isfinite(image).all():
        files["non-finite.png"] = non_finite_png(image, exposure_ev)
    if visible is not None:
        files["difference.png"] = encode_png(difference_map(picture, visible), MAP_PALETTE)
    return files


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


def non_finite_png(image: Pixels, exposure_ev: float) -> bytes:
    """The picture that marks the pixels that are NaN or infinite on a merged image in dim grey."""
    codes = non_finite_map(encode_srgb(image, exposure_ev), non_finite_pixels(image))
    return encode_png(codes, MAP_PALETTE)


def flaw_of(image: Pixels) -> str | None:
    """What is wrong with a merged image, in words; None where it may be a result.

    A sum that is NaN or infinite stays so: an image with too many of them never mends.

    Parameters
    ----------
    image
        (height, width, 3) float32.
    """
    found = non_finite_pixels(image)
    allowed = allowed_non_finite(found.nan.size)
    if found.count <= allowed:
        return None
    return (
        f"{found.in_words()}, at most {allowed:,} may be, and more samples repair none: look where "
        f"non-finite.png marks them for {_CAUSES}, mend the scene, and render it again"
    )
