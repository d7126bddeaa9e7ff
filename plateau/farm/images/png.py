"""PNG files: written with 8 bits a channel, read with any."""

import io
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import png
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.PngImagePlugin import PngInfo

_BIT_DEPTH_OFFSET: Final = 24  # of a PNG file: signature, then the IHDR chunk


@dataclass(frozen=True, eq=False)
class CodeValues:
    """What a PNG file holds."""

    #: (height, width, 3) float32 in [0, 1]: R, G and B as they are written, over the largest.
    colour: NDArray[np.float32]
    #: (height, width) float32 in [0, 1], not premultiplied; None where the file is opaque.
    alpha: NDArray[np.float32] | None


def encode_png(
    pixels: NDArray[np.uint8],
    palette: NDArray[np.uint8] | None = None,
    texts: Mapping[str, str] | None = None,
) -> bytes:
    """Return a picture as a PNG file.

    Parameters
    ----------
    pixels
        (height, width, 3 or 4) uint8, or (height, width) codes of the palette.
    palette
        (256, 3) uint8.
    texts
        Text chunks by keyword.
    """
    picture, stream = Image.fromarray(pixels), io.BytesIO()
    if palette is not None:
        picture.putpalette(palette.tobytes())
    # On renderings this strategy compresses as well as the default one, in half its time or less.
    chunks = PngInfo()
    for keyword, text in (texts or {}).items():
        chunks.add_text(keyword, text)
    picture.save(stream, "PNG", compress_level=1, compress_type=zlib.Z_RLE, pnginfo=chunks)
    return stream.getvalue()


def encode_film(pictures: Iterable[bytes], fps: float, longest: int) -> bytes:
    """Return PNG files as one animated PNG, which plays for ever.

    Parameters
    ----------
    pictures
        The frames, of one size, 1 or more.
    fps
        Frames per second.
    longest
        The most pixels of the longer side; larger frames are scaled down.

    Raises
    ------
    ValueError
        One is no PNG file, or damaged.
    """
    frames = []
    for content in pictures:
        try:
            with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
                frame = picture.convert("RGB")
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
            raise ValueError(f"not a readable PNG file: {error}") from error
        frame.thumbnail((longest, longest), Image.Resampling.BOX)
        frames.append(frame)
    stream = io.BytesIO()
    frames[0].save(
        stream,
        "PNG",
        save_all=True,
        append_images=frames[1:],
        duration=1000 / fps,
        loop=0,
        compress_level=1,
    )
    return stream.getvalue()


def decode_png(content: bytes) -> CodeValues:
    """A PNG file's code values, whatever its kind: grey is spread, a palette looked up.

    Raises
    ------
    ValueError
        It is no PNG file, or damaged.
    """
    try:
        with Image.open(io.BytesIO(content), formats=("PNG",)) as picture:
            if content[_BIT_DEPTH_OFFSET] > 8:
                pixels, most = _sixteen_bits(content), 65535
            else:
                pixels, most = np.asarray(picture.convert("RGBA")), 255
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, png.Error) as error:
        raise ValueError(f"not a readable PNG file: {error}") from error
    values = pixels.astype(np.float32)
    values /= most
    opaque = bool((pixels[..., 3] == most).all())
    return CodeValues(values[..., :3], None if opaque else values[..., 3])


def _sixteen_bits(content: bytes) -> NDArray[Any]:
    """The pixels as (height, width, 4) uint16; Pillow would read colours with 8 bits."""
    width, height, rows, _ = png.Reader(bytes=content).asRGBA()
    pixels = np.array([np.frombuffer(row, np.uint16) for row in rows])
    return pixels.reshape(height, width, 4)
