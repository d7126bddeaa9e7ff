"""The textures: walnut, and the glazes of the tiles."""

import io

import numpy as np
import numpy.typing as npt
from PIL import Image

from plateau.scenes.bar.room import GLAZES
from plateau.scenes.build import noise

Picture = npt.NDArray[np.float64]


def walnut(seed: int) -> Picture:
    """Return walnut as sRGB in [0, 1], its grain along the columns' axis, repeating."""
    shape = (128, 512)
    y = np.arange(shape[0])[:, np.newaxis] / shape[0]
    rings = (5 * y + 1.3 * noise(shape, (4, 3), seed)) % 1.0
    rings = np.where(rings < 0.75, rings / 0.75, (1 - rings) / 0.25)
    pores = noise(shape, (64, 12), seed + 1)
    light = np.clip(0.72 - 0.42 * rings * rings + 0.5 * (pores - 0.5), 0, 1)[..., np.newaxis]
    wood: Picture = np.array([0.27, 0.15, 0.09]) + light * np.array([0.36, 0.24, 0.15])
    return wood


def glazes(seed: int) -> Picture:
    """Return the tiles' colours as sRGB in [0, 1], one pixel each."""
    shade = np.random.default_rng(seed).random((1, GLAZES, 1))
    colours: Picture = np.array([0.06, 0.36, 0.33]) + shade * np.array([0.10, 0.22, 0.18])
    return colours


def textures() -> dict[str, bytes]:
    """Return the textures as PNG by file name."""
    return {"walnut.png": _png(walnut(seed=5)), "glazes.png": _png(glazes(seed=6))}


def _png(picture: Picture) -> bytes:
    stream = io.BytesIO()
    image = Image.fromarray(np.round(picture * 255).astype(np.uint8))
    image.quantize(64).save(stream, "PNG", optimize=True)
    return stream.getvalue()
