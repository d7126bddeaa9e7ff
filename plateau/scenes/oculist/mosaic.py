"""A mosaic of an eye: an emblem laid in rings within a Greek key laid in rows."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from plateau.scenes.oculist.lettering import Field

#: Pixels along the side, and tesserae along the side.
_SIZE = 640
_COUNT = 56
#: Radius of the emblem, where the panel's side is 1.
_EMBLEM = 0.355
#: Tesserae across the border.
_KEY = 7
#: Half the narrowest joint, as a fraction of a tessera.
_MORTAR = 0.09
_CIRCLE = 6.283185307

#: The lightest shade of each kind of stone, in sRGB levels.
_STONES = {
    "mortar": (86, 78, 68),
    "ink": (26, 26, 34),
    "cream": (226, 210, 178),
    "sand": (196, 164, 112),
    "white": (240, 236, 224),
    "red": (148, 44, 30),
    "rose": (204, 128, 96),
    "blue": (28, 70, 116),
    "sky": (84, 150, 176),
    "green": (44, 104, 84),
    "gold": (222, 164, 44),
}
_NAMES = tuple(_STONES)
_SHADES = 5

# Seven by seven, to be repeated along the border.
_MEANDER = (
    "#######",
    "#......",
    "#.####.",
    "#.#..#.",
    "#.##.#.",
    "#....#.",
    "######.",
)


@dataclass(frozen=True)
class _Stones:
    """For every pixel: what is known of its stone, and where in the stone it is."""

    x: Field  # the stone's centre, from -0.5 to 0.5
    y: Field
    edge: Field  # how far the pixel is from the stone's edge, in tesserae
    tilt: Field  # where the pixel is within a stone, -1 to 1, times the stone's slope
    shade: npt.NDArray[np.int64]


def mosaic(seed: int) -> tuple[npt.NDArray[np.uint8], list[int], Field]:
    """Return the mosaic.

    Returns
    -------
    (stones, palette, relief)
        An index of a colour for every pixel, the colours as bytes in RGB order, and the height in
        [0, 1].
    """
    y, x = (np.mgrid[0:_SIZE, 0:_SIZE] + 0.5) / _SIZE - 0.5
    radius = np.sqrt(x * x + y * y)
    rows, rings = _rows(x, y, seed), _rings(x, y, radius, seed + 1)
    within = radius < _EMBLEM
    stones = _Stones(
        *(
            np.where(within, getattr(rings, name), getattr(rows, name))
            for name in ("x", "y", "edge", "tilt", "shade")
        )
    )
    edge = np.minimum(stones.edge, np.abs(radius - _EMBLEM) * _COUNT)
    colour = np.where(within, _emblem(stones.x, stones.y), _field(stones.x, stones.y))
    index = np.where(edge < _MORTAR, 0, 1 + (colour - 1) * _SHADES + stones.shade)
    rise = np.clip((edge - _MORTAR / 2) / 0.22, 0, 1)
    relief = rise * (2 - rise) * (0.8 + 0.2 * stones.tilt)
    return index.astype(np.uint8), _palette(), relief


def _palette() -> list[int]:
    palette = list(_STONES["mortar"])
    for name in _NAMES[1:]:
        for shade in range(_SHADES):
            darker = 0.66 + 0.34 * shade / (_SHADES - 1)
            palette += [round(level * darker) for level in _STONES[name]]
    return palette


def _rows(x: Field, y: Field, seed: int) -> _Stones:
    """Return stones laid square, each a little out of line."""
    across, down = (x + 0.5) * _COUNT, (y + 0.5) * _COUNT
    column = np.clip(np.floor(across).astype(int), 0, _COUNT - 1)
    row = np.clip(np.floor(down).astype(int), 0, _COUNT - 1)
    return _laid(
        across - column,
        down - row,
        row * _COUNT + column,
        (column + 0.5) / _COUNT - 0.5,
        (row + 0.5) / _COUNT - 0.5,
        seed,
    )


def _rings(x: Field, y: Field, radius: Field, seed: int) -> _Stones:
    """Return stones laid in rings about the middle."""
    course = radius * _COUNT
    ring = np.floor(course).astype(int)
    count = np.round(_CIRCLE * (ring + 0.5))
    start = np.random.default_rng(seed).random(_COUNT)[np.minimum(ring, _COUNT - 1)]
    along = _turn(x, y) * count + start
    stone = np.floor(along)
    angle = _CIRCLE * (stone + 0.5 - start) / count
    return _laid(
        along - stone,
        course - ring,
        ring * 512 + (stone % count).astype(int),
        np.round((ring + 0.5) / _COUNT * np.cos(angle), 9),
        np.round((ring + 0.5) / _COUNT * np.sin(angle), 9),
        seed,
    )


def _turn(x: Field, y: Field) -> Field:
    """Return the direction of a point in turns, from 0.5 to 1.5.

    It is rounded far above the arctangent's last bit, so that every machine cuts the same stones.
    """
    return np.round(np.arctan2(y, x) / _CIRCLE + 1, 9)


def _laid(
    u: Field, v: Field, stone: npt.NDArray[np.int64], x: Field, y: Field, seed: int
) -> _Stones:
    """Return stones given where pixels are in them (0 to 1), their numbers and their centres."""
    generator = np.random.default_rng(seed)
    many = int(stone.max()) + 1
    inset = 0.10 * generator.random((4, many))[:, stone]
    slope = 2 * generator.random((2, many))[:, stone] - 1
    shade = np.floor(_SHADES * generator.random(many)).astype(int)[stone]
    edge = np.minimum(
        np.minimum(u - inset[0], 1 - inset[1] - u), np.minimum(v - inset[2], 1 - inset[3] - v)
    )
    return _Stones(x, y, edge, slope[0] * (2 * u - 1) + slope[1] * (2 * v - 1), shade)


def _stone(name: str) -> int:
    return _NAMES.index(name)


def _emblem(x: Field, y: Field) -> npt.NDArray[np.int64]:
    """Return the eye's stone at a point."""
    radius = np.sqrt(x * x + y * y)
    # An almond is where two discs overlap.
    half, reach = 0.150, 0.272
    bend = (reach * reach - half * half) / (2 * half)
    lid = bend + half
    almond = lid - np.sqrt(x * x + (np.abs(y) + bend) ** 2)
    brow = np.abs(np.sqrt(x * x + (y - 0.20) ** 2) - 0.415)
    turn = _turn(x, y)
    iris = np.where(np.floor(turn * 24) % 2 > 0, _stone("sky"), _stone("blue"))
    ring = np.where(np.floor(turn * 32) % 2 > 0, _stone("red"), _stone("gold"))
    inside = almond > 0
    glint = (x + 0.035) ** 2 + (y + 0.040) ** 2 < 0.020**2
    # From the outside to the pupil, then back from the white of the eye to the brow.
    laid = (
        (radius > 0.335, _stone("ink")),
        (radius > 0.300, ring),
        (inside & glint, _stone("white")),
        (inside & (radius < 0.052), _stone("ink")),
        (inside & (radius < 0.075), _stone("gold")),
        (inside & (radius < 0.118), iris),
        (inside & (radius < 0.136), _stone("ink")),
        (almond > 0.028, _stone("white")),
        (inside, _stone("sky")),
        (almond > -0.022, _stone("ink")),
        (almond > -0.044, _stone("rose")),
        ((brow < 0.017) & (y < -0.1), _stone("ink")),
    )
    return np.select([where for where, _ in laid], [stone for _, stone in laid], _stone("sand"))


def _field(x: Field, y: Field) -> npt.NDArray[np.int64]:
    """Return the stone of the ground and of its border at a point."""
    column = np.floor((x + 0.5) * _COUNT).astype(int)
    row = np.floor((y + 0.5) * _COUNT).astype(int)
    inward = np.minimum(np.minimum(column, _COUNT - 1 - column), np.minimum(row, _COUNT - 1 - row))
    meander = np.array([[mark == "#" for mark in line] for line in _MEANDER])
    sideways = np.minimum(column, _COUNT - 1 - column) == inward
    key = meander[inward % _KEY, np.where(sideways, row, column) % _KEY]
    lozenge = (np.abs(column - (_COUNT - 1) / 2) + np.abs(row - (_COUNT - 1) / 2)) % 4
    return np.select(
        [inward < _KEY, inward == _KEY, inward == _KEY + 1],
        [np.where(key, _stone("blue"), _stone("cream")), _stone("red"), _stone("gold")],
        np.where(lozenge < 1.5, _stone("green"), _stone("cream")),
    )
