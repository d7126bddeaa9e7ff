"""The plants: each grows from the origin, about a metre tall or less, and is planted many times."""

import math
from collections.abc import Callable
from random import Random

import numpy as np

from plateau.scenes.mesh import Mesh
from plateau.scenes.plants.sheets import Points, Sheets, arching, blade, lathe, turned

GOLDEN_DEG = 137.50776


def fern() -> Mesh:
    """Return a fern: thirteen arching fronds, whose pinnae the mask cuts out."""
    random, fronds = Random(11), Sheets()
    for index in range(13):
        outer = index / 12
        spine = arching(
            length=random.uniform(0.62, 0.78) * (0.72 + 0.28 * outer),
            rise_deg=84 - 34 * outer + random.uniform(-6, 6),
            droop_deg=random.uniform(58, 78) + 25 * outer,
            azimuth_deg=index * GOLDEN_DEG + random.uniform(-12, 12),
            steps=9,
        )
        fronds.add(*blade(spine, lambda t: 0.125 * frond_outline(t), fold_deg=14, cut_out=True))
    return fronds.mesh()


def frond_outline(along: Points) -> Points:
    """Return half the width of a frond, 0 to 1: a bare stalk, widest at a third, a long point."""
    rise = np.clip((along - 0.04) / 0.3, 0, 1)
    fall = np.clip((1 - along) / 0.66, 0, 1)
    return np.minimum(np.sqrt(rise * (2 - rise)), fall**0.85) * 0.93 + 0.05 + 0.02 * (1 - along)


def hosta() -> Mesh:
    """Return a hosta: broad, pointed, cream-edged leaves on stalks."""
    random, leaves = Random(12), Sheets()
    for index in range(17):
        outer = index / 16
        azimuth = index * GOLDEN_DEG + random.uniform(-10, 10)
        stalk = arching(0.1 + 0.14 * outer, 76 - 30 * outer, 10, azimuth, 3)
        leaves.add(*blade(stalk, lambda t: 0.007 + 0 * t, fold_deg=35))
        spine = arching(
            length=random.uniform(0.19, 0.25) * (0.75 + 0.35 * outer),
            rise_deg=50 - 34 * outer + random.uniform(-8, 8),
            droop_deg=random.uniform(50, 75),
            azimuth_deg=azimuth + random.uniform(-14, 14),
            steps=7,
        )
        broad = Sheets()
        broad.add(*blade(spine, _broad(random.uniform(0.068, 0.084)), fold_deg=16, columns=5))
        leaves.place(broad, np.eye(3), stalk.points[-1])
    return leaves.mesh()


def _broad(half_width: float) -> Callable[[Points], Points]:
    return lambda along: half_width * _ovate(along)


def _ovate(along: Points) -> Points:
    return np.sin(math.pi * np.clip(along, 0, 1) ** 0.62) ** 0.8 + 0.02 * (1 - along)


def grass() -> Mesh:
    """Return a tuft of grass: thirty-two thin blades."""
    random, tuft = Random(13), Sheets()
    for _ in range(32):
        spine = arching(
            length=random.uniform(0.12, 0.3),
            rise_deg=random.uniform(58, 88),
            droop_deg=random.uniform(10, 90),
            azimuth_deg=random.uniform(0, 360),
            steps=4,
        )
        leaf = Sheets()
        leaf.add(*blade(spine, lambda t: 0.0042 * (1 - t**2), fold_deg=25, columns=3))
        tuft.place(leaf, np.eye(3), (random.gauss(0, 0.018), 0.0, random.gauss(0, 0.018)))
    return tuft.mesh()


def creeper() -> Mesh:
    """Return a patch of ground cover: round leaves close to the soil."""
    random, patch = Random(14), Sheets()
    for _ in range(34):
        distance, azimuth = 0.15 * math.sqrt(random.random()), random.uniform(0, 360)
        spine = arching(random.uniform(0.03, 0.055), random.uniform(-5, 35), 30, azimuth, 3)
        leaf = Sheets()
        leaf.add(*blade(spine, lambda t: 0.022 * np.sin(math.pi * np.clip(t, 0, 1) ** 0.8)))
        angle = random.uniform(0, 2 * math.pi)
        at = (distance * math.cos(angle), random.uniform(0.01, 0.05), distance * math.sin(angle))
        patch.place(leaf, np.eye(3), at)
    return patch.mesh()


def ivy() -> Mesh:
    """Return a sprig of ivy that hangs down a wall in the plane z = 0, leaves towards z.

    Each leaf is a card, bent at its midrib, whose lobes the mask cuts out.
    """
    random, sprig = Random(15), Sheets()
    for index in range(15):
        along = index / 14
        centre = np.array(
            [0.05 * math.sin(5 * along) + random.uniform(-0.045, 0.045), -0.42 * along, 0.012]
        )
        size = random.uniform(0.036, 0.06) * (1.1 - 0.4 * along)
        leaf = Sheets()
        leaf.add(*_ivy_card(size))
        turn = turned(
            x_deg=random.uniform(-38, -4),
            y_deg=random.uniform(-32, 32),
            z_deg=random.uniform(-48, 48),
        )
        sprig.place(leaf, turn, centre + np.array([0.0, 0.0, random.uniform(0.01, 0.05)]))
    return sprig.mesh()


def _ivy_card(size: float) -> tuple[Points, Points]:
    """Return a card that keeps close to an ivy leaf's lobes: ten triangles about its middle."""
    reach = np.array(
        [
            *((0.0, -0.42), (0.62, -0.84), (0.98, -0.1), (0.62, 0.62), (0.22, 0.98)),
            *((-0.22, 0.98), (-0.62, 0.62), (-0.98, -0.1), (-0.62, -0.84), (0.0, -0.42)),
        ]
    )
    x, y = np.stack([np.zeros_like(reach), reach]).transpose(2, 0, 1)
    z = 0.3 * np.abs(x) - 0.2 * y**2
    return np.stack([x, y, z], axis=-1) * size, np.stack([(x + 1) / 2, (y + 1) / 2], axis=-1)


def bough() -> Mesh:
    """Return a bough of a tree overhead: seventy plain leaves about the x axis."""
    random, branch = Random(16), Sheets()
    for _ in range(70):
        along = random.random()
        spread = 0.06 + 0.2 * math.sin(math.pi * along)
        spine = arching(
            random.uniform(0.09, 0.14), random.uniform(-50, 30), 30, random.uniform(0, 360), 2
        )
        leaf = Sheets()
        leaf.add(*blade(spine, lambda t: 0.04 * np.sin(math.pi * (0.15 + 0.85 * t))))
        at = (along, random.gauss(0, 0.5) * spread, random.gauss(0, 1.0) * spread)
        branch.place(leaf, np.eye(3), at)
    return branch.mesh()


def foxglove_bells() -> Mesh:
    """Return the flowers of a foxglove's spire, largest below, the topmost still buds."""
    random, bells = Random(17), Sheets()
    bell = Sheets()
    profile = ((0.006, 0.0), (0.016, -0.012), (0.017, -0.034), (0.024, -0.05))
    bell.add(*lathe(profile, 7))
    for index in range(30):
        along = index / 29
        size = (1.05 - 0.72 * along) * random.uniform(0.9, 1.1)
        azimuth = index * GOLDEN_DEG * 0.62 + random.uniform(-15, 15)
        tilt = turned(z_deg=58 - 30 * along) * size
        radians = math.radians(azimuth)
        at = (0.012 * math.cos(radians), 0.46 + 0.46 * along, -0.012 * math.sin(radians))
        bells.place(bell, turned(y_deg=azimuth) @ tilt, at)
    return bells.mesh()


def foxglove_stem() -> Mesh:
    """Return the stem of a foxglove and the leaves at its foot."""
    random, parts = Random(18), Sheets()
    parts.add(*lathe(((0.009, 0.0), (0.007, 0.5), (0.002, 0.96)), 5))
    for index in range(12):
        spine = arching(
            random.uniform(0.16, 0.26), random.uniform(25, 60), 70, index * GOLDEN_DEG, 5
        )
        parts.add(*blade(spine, lambda t: 0.045 * _ovate(t), fold_deg=18))
    for index in range(6):
        spine = arching(0.1 - 0.008 * index, 50, 60, index * GOLDEN_DEG + 40, 4)
        leaf = Sheets()
        leaf.add(*blade(spine, lambda t: 0.018 * _ovate(t), fold_deg=18))
        parts.place(leaf, np.eye(3), (0.0, 0.14 + 0.05 * index, 0.0))
    return parts.mesh()


def daisy_flowers() -> Mesh:
    """Return the flowers of a bush of daisies: shallow dishes whose petals the mask cuts out."""
    flowers = Sheets()
    for at, lean_deg, azimuth_deg, size in _daisy_heads():
        turn = turned(y_deg=azimuth_deg) @ turned(z_deg=-lean_deg) * size
        dish, centre = Sheets(), Sheets()
        for part, profile, segments in (
            (dish, ((0.0, 0.06), (0.55, 0.12), (1.0, 0.05)), 10),
            (centre, ((0.27, 0.08), (0.2, 0.19), (0.0, 0.23)), 8),
        ):
            points, _ = lathe(profile, segments)
            part.add(points, 0.5 + 0.5 * points[..., [0, 2]])
        flowers.place(dish, turn, at)
        flowers.place(centre, turn, at)
    return flowers.mesh()


def daisy_leaves() -> Mesh:
    """Return the stalks and leaves of a bush of daisies."""
    random, parts = Random(20), Sheets()
    for at, lean_deg, azimuth_deg, _ in _daisy_heads():
        length = math.dist(at, (0, 0, 0))
        spine = arching(length, 90 - 0.55 * lean_deg, 0.3 * lean_deg, azimuth_deg, 4)
        straight = spine.along[:, None] * (np.asarray(at) - spine.points[-1])
        points, uvs = blade(spine, lambda t: 0.003 + 0 * t)
        parts.add(points + straight[:, None], uvs)
    for _ in range(230):
        spine = arching(
            random.uniform(0.06, 0.11),
            random.uniform(0, 70),
            random.uniform(20, 60),
            random.uniform(0, 360),
            3,
        )
        leaf = Sheets()
        leaf.add(*blade(spine, lambda t: 0.014 * _ovate(t), fold_deg=24))
        radius, angle = 0.22 * math.sqrt(random.random()), random.uniform(0, 2 * math.pi)
        height = random.uniform(0.0, 0.31) * (1 - (radius / 0.28) ** 2)
        parts.place(leaf, np.eye(3), (radius * math.cos(angle), height, radius * math.sin(angle)))
    return parts.mesh()


def _daisy_heads() -> list[tuple[tuple[float, float, float], float, float, float]]:
    """Return where each flower is, how far it leans, towards where, and its radius."""
    random = Random(19)
    heads = []
    for index in range(54):
        lean_deg = 62 * math.sqrt((index + 0.5) / 54) + random.uniform(-9, 9)
        azimuth_deg = index * GOLDEN_DEG + random.uniform(-15, 15)
        reach = random.uniform(0.22, 0.38)
        lean, azimuth = math.radians(lean_deg), math.radians(azimuth_deg)
        at = (
            reach * 0.85 * math.sin(lean) * math.cos(azimuth),
            reach * (0.2 + 0.8 * math.cos(lean)),
            -reach * 0.85 * math.sin(lean) * math.sin(azimuth),
        )
        heads.append((at, lean_deg, azimuth_deg, random.uniform(0.031, 0.044)))
    return heads
