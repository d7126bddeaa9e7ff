"""The textures as arrays: cloth, inscriptions, stone, wood; and how they become PNG."""

import io
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from PIL import Image

from plateau.scenes.build import noise
from plateau.scenes.oculist.lettering import Field, cut

Bytes = npt.NDArray[np.uint8]


def png(pixels: Bytes, palette: Sequence[int] = ()) -> bytes:
    """Return pixels as PNG: grey, RGB, or indices of a palette, which is bytes in RGB order."""
    image = Image.fromarray(pixels)
    if palette:
        image.putpalette(palette)
    stream = io.BytesIO()
    image.save(stream, "PNG", optimize=True)
    return stream.getvalue()


def grey(field: Field, levels: int) -> bytes:
    """Return a field in [0, 1] as a grey PNG; fewer levels make a smaller file."""
    steps = np.round(np.clip(field, 0, 1) * (levels - 1))
    return png(np.round(steps * (255 / (levels - 1))).astype(np.uint8))


def tinted(field: Field, dark: Sequence[int], light: Sequence[int], shades: int = 32) -> bytes:
    """Return a field in [0, 1] as a PNG of so many shades between two colours, in sRGB levels."""
    low, high = np.array(dark, float), np.array(light, float)
    parts = np.arange(shades)[:, np.newaxis] / (shades - 1)
    palette = np.round(low + parts * (high - low)).astype(int).ravel().tolist()
    return png(np.round(np.clip(field, 0, 1) * (shades - 1)).astype(np.uint8), palette)


def grain(size: int, seed: int) -> Field:
    """Return the grain of stone in [0, 1]: noise of four sizes, repeating at the edges."""
    field = np.zeros((size, size))
    octaves = ((4, 0.15), (16, 0.20), (48, 0.30), (size // 2, 0.35))
    for number, (cells, weight) in enumerate(octaves):
        field += weight * noise((size, size), (cells, cells), seed + number)
    return np.clip(0.5 + 2.2 * (field - 0.5), 0, 1)


def wood(shape: tuple[int, int], seed: int) -> Field:
    """Return the grain of oak in [0, 1], running along the columns' axis, repeating."""
    rows, columns = shape
    broad = noise(shape, (6, 2), seed)
    y = np.arange(rows)[:, np.newaxis] / rows
    rings = (y * 9 + 1.6 * broad) % 1.0
    rings = np.where(rings < 0.8, rings / 0.8, (1 - rings) / 0.2)
    pores = noise(shape, (rows // 2, columns // 32), seed + 1)
    return np.clip(0.75 - 0.40 * rings * rings + 0.7 * (pores - 0.5), 0, 1)


def inscribed(shape: tuple[int, int], lines: Sequence[str], seed: int) -> tuple[Field, Field]:
    """Return an inscribed slab: how light it is, and its height, both in [0, 1].

    The letters are cut, then the colour that masons filled them with has half gone.
    """
    letters = cut(shape, lines, stroke=1.15, margin=0.05)
    weather = noise(shape, (shape[0] // 3, shape[1] // 3), seed)
    stains = noise(shape, (9, 7), seed + 1)
    light = 0.56 + 0.30 * (weather - 0.5) + 0.35 * (stains - 0.5)
    light -= 0.60 * np.clip(2 * letters, 0, 1) * (0.5 + 0.5 * stains)
    return light, 0.9 - 0.8 * letters + 0.1 * weather


#: Threads along the side of the cloth's repeat, threads along a diamond's, pixels for each thread.
_THREADS = 48
_DIAMOND = 24
_THREAD_PIXELS = 8
#: Threads of each coloured stripe.
_STRIPE = 4
_INDIGO, _MADDER, _LINEN = (34, 48, 92), (140, 40, 34), (224, 206, 168)


def cloth(seed: int) -> tuple[Bytes, Field]:
    """Return a diamond twill that repeats: its colour as RGB and its height in [0, 1]."""
    y, x = np.mgrid[0 : _THREADS * _THREAD_PIXELS, 0 : _THREADS * _THREAD_PIXELS]
    weft, warp = y // _THREAD_PIXELS, x // _THREAD_PIXELS
    # Over two, under two; the twill's line turns back in the middle of a diamond, both ways.
    folded = np.abs(warp % _DIAMOND - _DIAMOND // 2) + np.abs(weft % _DIAMOND - _DIAMOND // 2)
    warp_over = folded % 4 < 2
    # From -1 to 1 across each thread: it is round across and sags a little along.
    u, v = (2 * (place % _THREAD_PIXELS + 0.5) / _THREAD_PIXELS - 1 for place in (x, y))
    height = 1 - np.where(warp_over, 0.8 * u * u + 0.2 * v * v, 0.8 * v * v + 0.2 * u * u)
    dyed = np.random.default_rng(seed).random((2, _THREADS)) - 0.5
    light = 0.55 + 0.45 * height + 0.3 * np.where(warp_over, dyed[0][warp], dyed[1][weft])
    warps = np.where((warp < _STRIPE)[..., np.newaxis], _MADDER, _INDIGO)
    wefts = np.where((weft < _STRIPE)[..., np.newaxis], _MADDER, _LINEN)
    colour = np.where(warp_over[..., np.newaxis], warps, wefts) * light[..., np.newaxis]
    return np.round(np.clip(colour, 0, 255)).astype(np.uint8), height
