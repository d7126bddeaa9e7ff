"""The textures: pictures of leaves with their masks, and of plaster, stone, soil and clay.

All are made of sums of sines and of seeded noise; a picture is (H, W, 3), a mask (H, W), in 0..1.
Row 0 is v = 0, a leaf's foot.
"""

import io
import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from plateau.scenes.plants.flora import frond_outline

Plane = NDArray[np.float64]
Colour = tuple[float, float, float]

#: Samples on each axis for each pixel of a leaf's mask.
_FINER = 4


def textures() -> dict[str, Plane]:
    """Return the textures by file name."""
    frond, frond_mask = _frond(96, 384)
    ivy, ivy_mask = _ivy(128)
    daisy, daisy_mask = _daisy(128)
    return {
        "frond.png": frond,
        "frond_mask.png": frond_mask,
        "ivy_leaf.png": ivy,
        "ivy_leaf_mask.png": ivy_mask,
        "petals.png": daisy,
        "petals_mask.png": daisy_mask,
        "hosta_leaf.png": _hosta(64, 128),
        "bell.png": _foxglove(64, 64),
        "plaster.png": _plaster(320),
        "stone.png": _stone(224),
        "earth.png": _soil(160),
        "clay.png": _clay(192),
    }


def to_png(picture: Plane) -> bytes:
    """Return a picture or mask as an 8-bit PNG."""
    levels = np.clip(np.rint(picture * 255), 0, 255).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(levels).save(stream, "png", optimize=True)
    return stream.getvalue()


def noise(size: int, cells: int, seed: int, octaves: int = 4) -> Plane:
    """Return noise that tiles, (size, size) in 0..1: octaves of smoothly interpolated values."""
    random = np.random.default_rng(seed)
    total, weight, amplitude = np.zeros((size, size)), 0.0, 1.0
    for _ in range(octaves):
        lattice = random.random((cells, cells))
        at = np.arange(size) * cells / size
        low = np.floor(at).astype(int)
        share = at - low
        share = share * share * (3 - 2 * share)
        high = (low + 1) % cells
        rows = lattice[low] * (1 - share)[:, None] + lattice[high] * share[:, None]
        total += amplitude * (rows[:, low] * (1 - share) + rows[:, high] * share)
        weight, amplitude, cells = weight + amplitude, amplitude / 2, cells * 2
    return total / weight


def blend(share: Plane, low: Colour, high: Colour) -> Plane:
    """Return the mixture of two colours, `share` of it the second."""
    share = np.clip(share, 0, 1)[..., None]
    return np.asarray(low) * (1 - share) + np.asarray(high) * share


def _grid(width: int, height: int, finer: int = 1) -> tuple[Plane, Plane]:
    """Return x in -1..1 and v in 0..1 at the pixels' centres."""
    x = (np.arange(width * finer) + 0.5) / (width * finer) * 2 - 1
    v = (np.arange(height * finer) + 0.5) / (height * finer)
    across, along = np.meshgrid(x, v)
    return across, along


def _coarser(mask: NDArray[np.bool_]) -> Plane:
    height, width = mask.shape
    parts = mask.reshape(height // _FINER, _FINER, width // _FINER, _FINER)
    share: Plane = parts.mean(axis=(1, 3))
    return share


def _frond(width: int, height: int) -> tuple[Plane, Plane]:
    """Return a fern's frond: pairs of toothed pinnae along a midrib."""

    def pinna(x: Plane, v: Plane) -> tuple[Plane, Plane]:
        """Return how far out along its pinna a point is, and how far from its midline, 0 to 1."""
        reach = np.maximum(frond_outline(v) - 0.02, 1e-3)
        out = np.abs(x) / reach
        phase = 30 * (v - 0.11 * np.abs(x)) + 0.5 * (x > 0)
        return out, np.abs(phase - np.floor(phase) - 0.5) * 2

    x, v = _grid(width, height, _FINER)
    out, off = pinna(x, v)
    teeth = 0.1 * np.cos(2 * math.pi * out * 7 * frond_outline(v))  # fewer towards the tip
    thick = 0.9 * np.sqrt(np.clip(1 - out, 0, 1)) * np.clip(1.25 - 0.5 * out, 0, 1) + teeth
    mask = ((off < thick) & (out < 1) & (v > 0.1)) | (np.abs(x) < 0.045 * (1.1 - v))
    x, v = _grid(width, height)
    out, off = pinna(x, v)
    colour = blend(0.25 + 0.5 * v + 0.25 * out, (0.10, 0.25, 0.035), (0.36, 0.56, 0.09))
    colour *= (1.08 - 0.22 * off**2)[..., None]
    stalk = np.clip(1.5 - np.abs(x) / 0.05, 0, 1)
    return _over(colour, stalk, (0.34, 0.30, 0.08)), _coarser(mask)


def _mix(low: Plane, high: Plane, share: Plane) -> Plane:
    mixed: Plane = low * (1 - share)[..., None] + high * share[..., None]
    return mixed


def _over(colour: Plane, share: Plane, top: Colour) -> Plane:
    return _mix(colour, np.asarray(top), share)


def _ivy(size: int) -> tuple[Plane, Plane]:
    """Return an ivy leaf: five lobes about the point where its pale veins meet."""
    lobes = ((90, 0.98), (33, 0.80), (147, 0.80), (-28, 0.62), (208, 0.62))

    def polar(finer: int) -> tuple[Plane, Plane]:
        x, v = _grid(size, size, finer)
        y = 2 * v - 1 + 0.22
        return np.hypot(x, y) / 1.16, np.arctan2(y, x)

    radius, angle = polar(_FINER)
    edge = np.full_like(radius, 0.34)
    for direction_deg, reach in lobes:
        apart = _apart(angle, direction_deg)
        edge = np.maximum(edge, reach * np.exp(-((np.abs(apart) / 0.42) ** 1.5)))
    notch = np.clip(1 - np.abs(_apart(angle, -90)) / 0.3, 0, 1)
    mask = radius < edge * (1 - 0.6 * notch)
    radius, angle = polar(1)
    colour = blend(0.3 + 0.5 * noise(size, 5, 31), (0.045, 0.15, 0.03), (0.14, 0.30, 0.06))
    for direction_deg, reach in lobes:
        apart = np.abs(_apart(angle, direction_deg)) * radius
        vein = np.clip(1 - apart / 0.028, 0, 1) * (radius < reach)
        colour = _over(colour, 0.65 * vein, (0.44, 0.52, 0.26))
    return colour, _coarser(mask)


def _apart(angle: Plane, direction_deg: float) -> Plane:
    """Return the angle to a direction, -π to π."""
    turn = angle - math.radians(direction_deg) + math.pi
    apart: Plane = turn - 2 * math.pi * np.floor(turn / (2 * math.pi)) - math.pi
    return apart


def _daisy(size: int) -> tuple[Plane, Plane]:
    """Return a daisy: seventeen white petals, and a yellow centre."""
    petals = 17

    def polar(finer: int) -> tuple[Plane, Plane]:
        x, v = _grid(size, size, finer)
        y = 2 * v - 1
        turn = np.arctan2(y, x) / (2 * math.pi) * petals
        return np.hypot(x, y), np.abs(turn - np.floor(turn) - 0.5) * 2

    radius, off = polar(_FINER)
    round_tip = np.sqrt(np.clip(1 - (np.clip(radius - 0.72, 0, None) / 0.25) ** 2, 0, 1))
    mask = (radius < 0.34) | ((off < 0.86 * round_tip) & (radius < 0.97))
    radius, off = polar(1)
    shade = 0.80 - 0.16 * off**2 - 0.10 * np.clip(1 - radius / 0.6, 0, 1)
    colour = shade[..., None] * np.array([1.0, 0.985, 0.95])
    seeds = 0.8 + 0.4 * noise(size, 24, 32, 1)
    centre = blend(radius / 0.28, (0.62, 0.30, 0.02), (0.85, 0.58, 0.05)) * seeds[..., None]
    colour = np.where((radius < 0.29)[..., None], centre, colour)
    return colour, _coarser(mask)


def _hosta(width: int, height: int) -> Plane:
    """Return a hosta's leaf: blue-green with curved ribs, and a cream edge that wanders."""
    x, v = _grid(width, height)
    ribs = np.cos(np.abs(x) * 9 * math.pi) * 0.5 + 0.5
    colour = blend(0.2 + 0.35 * v + 0.35 * ribs, (0.07, 0.21, 0.07), (0.20, 0.38, 0.13))
    wander = 0.10 * np.sin(9 * v + 2 * x) + 0.06 * np.sin(23 * v - 3 * x)
    edge = np.clip((np.abs(x) - 0.76 + wander + 0.12 * (v > 0.9)) / 0.06, 0, 1)
    colour = _over(colour, edge, (0.70, 0.68, 0.36))
    return _over(colour, 0.5 * np.clip(1 - np.abs(x) / 0.05, 0, 1), (0.42, 0.50, 0.24))


def _foxglove(width: int, height: int) -> Plane:
    """Return a foxglove's bell from its foot (v = 0) to its mouth."""
    _, v = _grid(width, height)
    colour = blend(v * 1.1, (0.55, 0.16, 0.42), (0.78, 0.30, 0.60))
    lip = np.clip((v - 0.82) / 0.12, 0, 1)
    colour = _over(colour, 0.75 * lip, (0.90, 0.68, 0.80))
    return _over(colour, np.clip(1 - v / 0.14, 0, 1), (0.25, 0.36, 0.10))


def _plaster(size: int) -> Plane:
    """Return old limewash, worn through to the bricks here and there."""
    worn = np.clip((noise(size, 3, 33, 5) - 0.575) / 0.03, 0, 1)
    limewash = blend(noise(size, 4, 34, 5) * 1.6 - 0.3, (0.40, 0.32, 0.235), (0.60, 0.52, 0.41))
    grain = 0.88 + 0.24 * noise(size, 40, 35, 2)
    return _mix(limewash, _bricks(size), worn) * grain[..., None]


def _bricks(size: int, courses: int = 28, across: int = 10) -> Plane:
    row, column = np.divmod(np.arange(size * size), size)
    course = (row * courses // size).reshape(size, size)
    up = (row * courses / size).reshape(size, size) % 1
    turn = (column * across / size).reshape(size, size) + 0.5 * (course % 2)
    along, brick = turn % 1, np.floor(turn).astype(int) % across
    tint = np.random.default_rng(36).random((courses, across))[course, brick]
    clay = blend(tint, (0.27, 0.135, 0.095), (0.44, 0.25, 0.17))
    joint = np.maximum(up < 0.16, along < 0.055).astype(float)
    return _over(clay, joint, (0.45, 0.40, 0.33))


def _stone(size: int) -> Plane:
    """Return sandstone with lichen."""
    colour = blend(noise(size, 4, 37, 6), (0.22, 0.205, 0.18), (0.52, 0.48, 0.41))
    colour = _over(
        colour, 0.6 * np.clip((noise(size, 6, 38) - 0.58) / 0.08, 0, 1), (0.20, 0.25, 0.09)
    )
    return _over(
        colour, 0.5 * np.clip((noise(size, 14, 39, 2) - 0.72) / 0.05, 0, 1), (0.62, 0.60, 0.50)
    )


def _soil(size: int) -> Plane:
    """Return dark soil with moss."""
    colour = blend(noise(size, 16, 40), (0.05, 0.035, 0.022), (0.17, 0.12, 0.08))
    moss = np.clip((noise(size, 5, 41) - 0.42) / 0.12, 0, 1)
    return _mix(colour, blend(noise(size, 24, 42, 2), (0.06, 0.13, 0.02), (0.17, 0.27, 0.05)), moss)


def _clay(size: int) -> Plane:
    """Return terracotta, turned on a wheel, with a bloom of lime."""
    rings = 0.04 * np.sin(np.arange(size) * 1.3)[:, None] + noise(size, 5, 43, 4)
    colour = blend(rings, (0.42, 0.17, 0.08), (0.66, 0.33, 0.18))
    bloom = np.clip((noise(size, 3, 44, 5) - 0.52) / 0.2, 0, 1)
    return _over(colour, 0.45 * bloom, (0.68, 0.58, 0.48))
