"""The room: x to the right, y up, z towards the camera; lengths in metres, the floor at 0.

The back bar stands along the left wall, the counter in front of it; the window is at the far end.
"""

import random

from plateau.scenes.mesh import Mesh, Vector, cuboid, grained, joined, quads

# The room's walls.
LEFT, RIGHT, FAR, NEAR, TALL = -1.85, 2.30, -3.40, 3.80, 2.90

#: The counter's top: its edges, and its height.
COUNTER_LEFT, COUNTER_RIGHT, COUNTER_FAR, COUNTER_TOP = -0.60, 0.06, -2.40, 1.10
_FRONT = -0.06  # the counter's tiled front

#: The back bar's bays, from the far end to the near one, as edges along z.
BAYS = (-2.80, -1.40, 0.0, 1.40)
#: Tops of its shelves; bottles stand on the first, a slab of stone, and on the others.
SHELVES = (0.95, 1.36, 1.77)
#: Middle of a shelf across.
SHELF_X = -1.585
_PANEL, _SHELF_BACK, _SHELF_FRONT, _CORNICE = -1.78, -1.68, -1.49, 2.20

#: The window: its edges and its middle.
WINDOW_LEFT, WINDOW_RIGHT, WINDOW_LOW, WINDOW_HIGH = 0.30, 1.70, 0.95, 2.45

#: Length of the wood texture's repeat along and across the grain.
_WOOD = (1.2, 0.3)
#: Colours of tile in their texture, side by side.
GLAZES = 8


def plank(low: Vector, high: Vector) -> Mesh:
    """Return a cuboid between two corners; the texture's grain runs along its longest edge."""
    edges = [high[axis] - low[axis] for axis in range(3)]
    return grained(quads(*cuboid(low, high)), edges.index(max(edges)), _WOOD)


def shell() -> dict[str, Mesh]:
    """Return the room's insides: walls, ceiling, floor and the panels behind the bottles."""
    a, b, c, d = (LEFT, 0, NEAR), (RIGHT, 0, NEAR), (RIGHT, 0, FAR), (LEFT, 0, FAR)
    e, f, g, h = (LEFT, TALL, NEAR), (RIGHT, TALL, NEAR), (RIGHT, TALL, FAR), (LEFT, TALL, FAR)
    floor = quads((a, b, c, d))
    tiles = tuple((x / 0.6, z / 0.6) for x, _, z in floor.vertices)
    return {
        "floor": Mesh(floor.vertices, floor.faces, uvs=tiles),
        "ceiling": quads((e, h, g, f)),
        "walls": quads((b, a, e, f), (c, b, f, g), (d, c, g, h), (a, d, h, e)),
        "onyx": joined(_panel(BAYS[0], BAYS[1]), _panel(BAYS[2], BAYS[3])),
        "mirror": _panel(BAYS[1], BAYS[2]),
    }


def _panel(far: float, near: float) -> Mesh:
    low, high = SHELVES[0], _CORNICE
    return quads(
        ((_PANEL, low, near), (_PANEL, low, far), (_PANEL, high, far), (_PANEL, high, near))
    )


def woodwork() -> Mesh:
    """Return everything of wood: counter, back bar, panelling and the window's frame."""
    far, near = BAYS[0], BAYS[-1]
    planks = [
        plank((COUNTER_LEFT, COUNTER_TOP - 0.05, COUNTER_FAR), (COUNTER_RIGHT, COUNTER_TOP, NEAR)),
        plank((-0.52, 0.0, COUNTER_FAR + 0.06), (_FRONT - 0.012, COUNTER_TOP - 0.05, NEAR)),
        plank((-0.50, 0.0, COUNTER_FAR + 0.03), (_FRONT, 0.10, NEAR)),
        plank((LEFT, 0.0, far), (-1.42, SHELVES[0] - 0.035, near)),
        plank((LEFT, _CORNICE, far - 0.04), (-1.45, _CORNICE + 0.03, near + 0.04)),
        plank((-1.49, _CORNICE - 0.10, far), (-1.47, _CORNICE, near)),
        plank((-1.47, _CORNICE + 0.03, far - 0.04), (-1.45, _CORNICE + 0.10, near + 0.04)),
    ]
    planks += [
        plank((_PANEL, SHELVES[0], z - 0.04), (_SHELF_FRONT + 0.02, _CORNICE, z + 0.04))
        for z in BAYS
    ]
    planks += [
        plank((_SHELF_BACK, top - 0.025, BAYS[z] + 0.04), (_SHELF_FRONT, top, BAYS[z + 1] - 0.04))
        for z in range(3)
        for top in SHELVES[1:]
    ]
    return joined(*planks, *_panelling(), *_window_frame())


def _panelling() -> list[Mesh]:
    """Return the panelling of the far and the right wall, with stiles, and its rails."""
    planks = [
        plank((-1.40, 0.0, FAR), (RIGHT, 0.86, FAR + 0.02)),
        plank((RIGHT - 0.02, 0.0, FAR), (RIGHT, 0.86, NEAR)),
    ]
    for low, high, out in ((0.0, 0.14, 0.04), (0.78, 0.86, 0.04), (0.86, 0.89, 0.06)):
        planks.append(plank((-1.40, low, FAR), (RIGHT, high, FAR + out)))
        planks.append(plank((RIGHT - out, low, FAR), (RIGHT, high, NEAR)))
    planks += [
        plank((x - 0.045, 0.14, FAR), (x + 0.045, 0.78, FAR + 0.035))
        for x in (-0.90, -0.25, 0.40, 1.05, 1.70)
    ]
    planks += [
        plank((RIGHT - 0.035, 0.14, z - 0.045), (RIGHT, 0.78, z + 0.045))
        for z in (-2.75, -2.10, -1.45, -0.80, -0.15, 0.50, 1.15, 1.80, 2.45, 3.10)
    ]
    return planks


def _window_frame() -> list[Mesh]:
    left, right, low, high = WINDOW_LEFT, WINDOW_RIGHT, WINDOW_LOW, WINDOW_HIGH
    width = 0.07
    frame = [
        plank((left - width, low - width, FAR), (right + width, low, FAR + 0.10)),
        plank((left - width, high, FAR), (right + width, high + width, FAR + 0.08)),
        plank((left - width, low, FAR), (left, high, FAR + 0.08)),
        plank((right, low, FAR), (right + width, high, FAR + 0.08)),
    ]
    bars = 4
    step = (right - left) / bars
    frame += [
        plank((left + k * step - 0.013, low, FAR), (left + k * step + 0.013, high, FAR + 0.045))
        for k in range(1, bars)
    ]
    frame += [plank((left, y - 0.013, FAR), (right, y + 0.013, FAR + 0.04)) for y in (1.45, 1.95)]
    return frame


def slab() -> Mesh:
    """Return the stone on top of the cabinets of the back bar."""
    return plank((LEFT, SHELVES[0] - 0.035, BAYS[0] - 0.02), (-1.40, SHELVES[0], BAYS[-1] + 0.02))


def trim() -> Mesh:
    """Return the flat brass: along the counter's edge, its foot, and the shelves' fronts."""
    edge = (COUNTER_TOP - 0.052, COUNTER_TOP + 0.002)
    strips = [
        plank((COUNTER_RIGHT, edge[0], COUNTER_FAR), (COUNTER_RIGHT + 0.006, edge[1], NEAR)),
        plank((COUNTER_LEFT, edge[0], COUNTER_FAR - 0.006), (COUNTER_RIGHT, edge[1], COUNTER_FAR)),
    ]
    strips += [
        plank(
            (_SHELF_FRONT, top - 0.025, BAYS[z] + 0.04),
            (_SHELF_FRONT + 0.004, top + 0.012, BAYS[z + 1] - 0.04),
        )
        for z in range(3)
        for top in SHELVES[1:]
    ]
    return joined(*strips)


def tiles(seed: int) -> Mesh:
    """Return the counter's front: small upright tiles, none of them quite straight."""
    chance = random.Random(seed)
    high, wide, joint, near = 0.1525, 0.05, 0.004, 1.9
    corners: list[tuple[Vector, Vector, Vector, Vector]] = []
    uvs: list[tuple[float, float]] = []
    for row in range(6):
        low = 0.105 + row * high
        z = COUNTER_FAR + 0.06
        while z < near:
            # How far each edge stands out from the grout.
            top, bottom = (0.004 + 0.002 * chance.random() for _ in range(2))
            left, right = (0.0015 * chance.random() for _ in range(2))
            far, upper = z + wide - joint, low + high - joint
            corners.append(
                (
                    (_FRONT - 0.012 + bottom + left, low, far),
                    (_FRONT - 0.012 + bottom + right, low, z),
                    (_FRONT - 0.012 + top + right, upper, z),
                    (_FRONT - 0.012 + top + left, upper, far),
                )
            )
            uvs += [((int(chance.random() * GLAZES) + 0.5) / GLAZES, 0.5)] * 4
            z += wide
    mesh = quads(*corners)
    return Mesh(mesh.vertices, mesh.faces, uvs=tuple(uvs))


def daylight() -> Mesh:
    """Return the wide window in the right wall, which the picture does not show."""
    x, low, high, near, far = RIGHT - 0.01, 1.0, 2.75, 2.6, -2.2
    return quads(((x, low, far), (x, low, near), (x, high, near), (x, high, far)))


def coves() -> Mesh:
    """Return the lights that face the ceiling from the back bar's top and from the right wall's."""
    y, far, near = _CORNICE + 0.04, BAYS[0] + 0.1, BAYS[-1] - 0.1
    return quads(
        *(
            ((left, y, near), (right, y, near), (right, y, far), (left, y, far))
            for left, right in ((-1.62, -1.48), (RIGHT - 0.44, RIGHT - 0.30))
        )
    )
