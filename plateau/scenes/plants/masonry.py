"""What does not grow: the wall, the soil, the flagstones and the pots."""

import math
from collections.abc import Sequence
from random import Random

import numpy as np

from plateau.scenes.mesh import Mesh, Vector
from plateau.scenes.plants.sheets import Points, Sheets, lathe

WALL_Z = -1.0
#: Where the pots stand.
POT_AT: Vector = (0.34, 0.03, -0.28)
JAR_AT: Vector = (0.72, 0.03, 0.16)


def wall() -> Mesh:
    """Return the wall behind everything, 5 wide and 2.8 high."""
    return _rectangle((-2.5, 0.0), (2.5, 2.8))


def _rectangle(low: tuple[float, float], high: tuple[float, float]) -> Mesh:
    x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
    sheet = Sheets()
    sheet.add(np.stack([x, y, np.full_like(x, WALL_Z)], axis=-1), np.stack([x, -y], axis=-1) / 2.5)
    return sheet.mesh()


def soil_height(x: float, z: float) -> float:
    """Return how high the soil is: a bed on the left, a little uneven everywhere."""
    bed = 1 / (1 + math.exp((x + 0.42 + 0.1 * math.sin(3 * z)) * 14))
    return 0.1 * bed + 0.012 * math.sin(7.3 * x + 1.1) * math.sin(6.1 * z)


def soil() -> Mesh:
    """Return the ground."""
    x, z = np.meshgrid(np.linspace(-2.5, 2.5, 41), np.linspace(WALL_Z, 4.0, 41))
    y = np.vectorize(soil_height)(x, z)
    sheet = Sheets()
    sheet.add(np.stack([x, y, z], axis=-1)[:, ::-1], np.stack([x, z], axis=-1)[:, ::-1] / 1.2)
    return sheet.mesh()


def flagstones() -> Mesh:
    """Return the paving: irregular stones with worn edges, none quite level."""
    random, stones, nodes = Random(21), Sheets(), _nodes()
    for row in range(len(nodes) - 1):
        for column in range(len(nodes[row]) - 1):
            near, far = nodes[row + 1, column : column + 2], nodes[row, column : column + 2]
            _lay(stones, np.concatenate([near, far[::-1]]), random)
    return stones.mesh()


def _nodes() -> Points:
    """Return where the stones meet, (rows, columns, 2) in x and z: a shaken grid."""
    random = Random(22)
    return np.array(
        [
            [
                (
                    -0.42 + 0.45 * column + random.uniform(-0.07, 0.07) + 0.2 * (row % 2),
                    WALL_Z + 0.18 + 0.36 * row + random.uniform(-0.05, 0.05),
                )
                for column in range(5)
            ]
            for row in range(9)
        ]
    )


def corners() -> list[tuple[float, float]]:
    """Return where four stones meet, in x and z."""
    return [(x, z) for x, z in _nodes()[1:-1, :-1].reshape(-1, 2).tolist()]


def _lay(stones: Sheets, corners: Points, random: Random) -> None:
    middle = corners.mean(axis=0)
    outline = _rounded(middle + (corners - middle) * 0.93)
    height = 0.035 + random.uniform(-0.008, 0.008)
    slope = (random.uniform(-0.012, 0.012), random.uniform(-0.012, 0.012))
    shift = (random.random(), random.random())

    def ring(inset: float, level: float) -> Points:
        x, z = (middle + (outline - middle) * (1 - inset)).T
        y = level + slope[0] * (x - middle[0]) + slope[1] * (z - middle[1])
        return np.stack([x, y, z], axis=-1)

    rings = np.stack(
        [
            ring(0.0, -0.03),
            ring(0.0, height - 0.008),
            ring(0.03, height),
            ring(1.0, height),
        ]
    )
    uvs = rings[..., [0, 2]] / 0.9 + np.array(shift)
    stones.add(rings[:3], uvs[:3])
    stones.add(rings[2:], uvs[2:])  # apart, so that the top is flat


def _rounded(corners: Points) -> Points:
    """Return a closed outline with each corner cut twice."""
    for cut in (0.13, 0.25):
        following = np.roll(corners, -1, axis=0)
        near, far = (1 - cut) * corners + cut * following, cut * corners + (1 - cut) * following
        corners = np.stack([near, far], axis=1).reshape(-1, 2)
    return np.concatenate([corners, corners[:1]])


def pot() -> Mesh:
    """Return a terracotta pot, 0.4 high and 0.46 across, with a rim."""
    return _turned_on_a_wheel(
        (
            *((0.0, 0.0), (0.148, 0.0), (0.158, 0.012), (0.2, 0.29), (0.203, 0.3)),
            *((0.222, 0.302), (0.228, 0.312), (0.232, 0.375), (0.224, 0.388)),
            *((0.205, 0.388), (0.2, 0.37), (0.19, 0.33), (0.0, 0.335)),
        ),
        36,
    )


def jar() -> Mesh:
    """Return a small glazed jar with a belly."""
    return _turned_on_a_wheel(
        (
            *((0.0, 0.0), (0.07, 0.0), (0.085, 0.012), (0.112, 0.06), (0.122, 0.105)),
            *((0.117, 0.15), (0.1, 0.182), (0.094, 0.194), (0.104, 0.208), (0.1, 0.214)),
            *((0.088, 0.205), (0.088, 0.18), (0.0, 0.18)),
        ),
        36,
    )


def _turned_on_a_wheel(profile: Sequence[tuple[float, float]], segments: int) -> Mesh:
    sheet = Sheets()
    sheet.add(*lathe(profile, segments))
    return sheet.mesh()
