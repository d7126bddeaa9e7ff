"""Where everything stands: the copies of each plant, scattered by a fixed seed."""

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

from plateau.scenes.mesh import Vector
from plateau.scenes.plants.masonry import JAR_AT, POT_AT, WALL_Z, corners, soil_height

#: Towards the sun.
SUN: Vector = (-0.62, 0.68, 0.38)


@dataclass(frozen=True)
class Placement:
    """One plant: scaled, leant about z, turned about the vertical, and moved to its place."""

    plant: str
    at: Vector
    scale: float = 1.0
    turn_deg: float = 0.0
    lean_deg: float = 0.0


def placements() -> list[Placement]:
    """Return where every plant stands."""
    random = Random(51)
    return [
        *_bed(random),
        *_grasses(random),
        *_ground_cover(random),
        *_ivy(random),
        *_boughs(random),
        *_pots(),
    ]


def _standing(
    plant: str, x: float, z: float, scale: float, turn_deg: float, lean_deg: float = 0.0
) -> Placement:
    return Placement(plant, (x, soil_height(x, z) - 0.01, z), scale, turn_deg, lean_deg)


def _bed(random: Random) -> Iterator[Placement]:
    """Yield the large plants, set by hand."""
    for x, z, scale in (
        *((-0.80, 0.72, 1.0), (-1.12, 0.1, 1.1), (-0.62, -0.18, 0.8), (-1.05, -0.55, 1.0)),
        *((-0.2, -0.8, 0.7), (1.02, -0.72, 0.85), (1.25, -0.25, 0.8), (-1.35, 0.95, 0.9)),
    ):
        yield _standing("fern", x, z, scale, random.uniform(0, 360))
    for x, z, scale in (
        *((0.98, 0.62, 1.15), (1.2, 0.15, 1.0), (-0.52, 0.3, 0.8), (0.66, -0.78, 0.9)),
        *((-0.56, 1.12, 0.75),),
    ):
        yield _standing("hosta", x, z, scale, random.uniform(0, 360))
    for x, z, scale in (
        *((-0.72, -0.62, 1.15), (-0.55, -0.78, 1.3), (-0.86, -0.82, 1.0), (-0.42, -0.6, 0.9)),
        *((-1.0, -0.7, 1.25), (-0.98, -0.3, 0.95), (0.88, -0.85, 1.0)),
    ):
        yield _standing("foxglove", x, z, scale, random.uniform(0, 360), random.uniform(-5, 5))


def _grasses(random: Random) -> Iterator[Placement]:
    for _ in range(34):
        x, z = random.uniform(-0.6, 1.5), WALL_Z + random.uniform(0.03, 0.16)
        yield _standing("grass", x, z, random.uniform(0.5, 1.1), random.uniform(0, 360))
    for _ in range(30):
        x, z = random.gauss(-0.42, 0.1), random.uniform(-0.8, 1.6)
        yield _standing("grass", x, z, random.uniform(0.4, 1.0), random.uniform(0, 360))


def _ground_cover(random: Random) -> Iterator[Placement]:
    for _ in range(70):
        x, z = random.uniform(-1.7, -0.42), random.uniform(-0.95, 1.7)
        yield _standing("creeper", x, z, random.uniform(0.7, 1.2), random.uniform(0, 360))
    for x, z in corners():
        yield _standing("creeper", x, z, random.uniform(0.3, 0.55), random.uniform(0, 360))


def _ivy(random: Random) -> Iterator[Placement]:
    """Yield the ivy: thick in the upper left corner, thinner to the right, hanging down."""
    for _ in range(76):
        x = random.uniform(-1.6, 1.6)
        depth = 1.05 * max(0.0, -x / 1.6) + 0.55 * max(0.0, (x - 0.5) / 1.1) + 0.14
        y = 2.1 - depth * random.random() ** 0.8
        at = (x, y, WALL_Z + 0.005)
        yield Placement("ivy", at, random.uniform(0.8, 1.25), 0.0, random.uniform(-25, 25))


def _boughs(random: Random) -> Iterator[Placement]:
    """Yield the boughs between the sun and the garden, all of them out of the picture.

    Each is set by where its shadow falls.
    """
    for x, y, z in (
        *((0.75, 1.75, WALL_Z), (1.15, 1.35, WALL_Z), (0.2, 1.95, WALL_Z), (1.3, 0.9, WALL_Z)),
        *((-1.1, 1.2, WALL_Z), (0.1, 1.15, WALL_Z), (-0.35, 1.75, WALL_Z), (0.8, 0.95, WALL_Z)),
        *((0.75, 0.0, 0.5), (0.1, 0.0, 0.95), (1.1, 0.0, -0.3), (-0.3, 0.0, 0.45)),
        *((-1.1, 0.2, 0.9), (-0.7, 0.2, 1.3), (0.5, 0.0, 1.5), (-1.2, 0.2, -0.3)),
        *((0.9, 0.0, 1.1), (0.05, 0.0, 0.05)),
    ):
        height = random.uniform(2.5, 3.0)
        distance = (height - y) / SUN[1]
        at = (x + distance * SUN[0], height, z + distance * SUN[2])
        yield Placement("bough", at, random.uniform(0.6, 1.0), random.uniform(0, 360))


def _pots() -> Iterator[Placement]:
    """Yield what grows in the pots, each a little below its rim."""
    for plant, (x, y, z), depth, scale in (
        ("daisies", POT_AT, 0.33, 1.12),
        ("grass", JAR_AT, 0.18, 1.0),
    ):
        yield Placement(plant, (x, y + depth, z), scale, 20.0)
