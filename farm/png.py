"""PNG files, 8 bits a channel."""

import io
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

_BIT_DEPTH_OFFSET: Final = 24  # of a PNG file: signature, then the IHDR chunk


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """An (height, width, 3) or (height, width, 4) uint8 picture as a PNG file."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", compress_level=3)
    return stream.getvalue()


def decode_png(content: bytes) -> NDArray[np.uint8]:
    """A PNG file as (height, width, 3) uint8; an opaque alpha is dropped, grey is spread.

    Raises
    ------
    ValueError
        It is no PNG file, has 16 bits a channel, or is partly transparent.
    """
    try:
        with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
            if content[_BIT_DEPTH_OFFSET] > 8:
                raise ValueError("the PNG file has 16 bits a channel; save it with 8, or as EXR")
            pixels = np.asarray(picture.convert("RGBA"))
    except (UnidentifiedImageError, OSError) as error:
        raise ValueError(f"not a readable PNG file: {error}") from error
    if (pixels[..., 3] < 255).any():
        raise ValueError("the PNG file is partly transparent; flatten it first")
    return np.ascontiguousarray(pixels[..., :3])
