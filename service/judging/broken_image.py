"""An image with too many pixels that are NaN or infinite: it is no result, and fails its job."""

from typing import Final

from plateau.farm.images.exr import Pixels
from plateau.farm.images.png import encode_png
from plateau.metric import (
    MAP_PALETTE,
    allowed_non_finite,
    encode_srgb,
    non_finite_map,
    non_finite_pixels,
)

_CAUSES: Final = (
    "an emitter whose radiance is NaN or infinite, or a texture or a material that divides by zero"
)


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
