"""Where everything is in the case: x to the right, y up, z towards the camera, floor at 0."""

from plateau.scenes.mesh import Mesh, Vector, cuboid, grained, joined, quads
from plateau.scenes.oculist.instruments import probe, scalpel, spoon, tweezers
from plateau.scenes.oculist.stamps import stamp
from plateau.scenes.oculist.surfaces import placed, plane

# The case's inside.
_X, _BACK, _FRONT, _TALL = 1.22, -0.80, 0.92, 1.36
_DEEP = _FRONT - _BACK

#: Side of the cloth's repeat, and lengths of the oak's along and across the grain.
_CLOTH = 0.42
_OAK = (0.5, 0.25)


def meshes() -> dict[str, Mesh]:
    """Return the meshes by file name."""
    return {
        "cloth.ply": plane(
            (-_X, 0, _FRONT), (2 * _X, 0, 0), (0, 0, -_DEEP), (2 * _X / _CLOTH, _DEEP / _CLOTH)
        ),
        "board.ply": plane((-_X, 0, _BACK), (2 * _X, 0, 0), (0, _TALL, 0), (5, 4)),
        "frieze.ply": _slab((0.0, 1.20), (2.24, 0.20)),
        "mosaic.ply": _slab((0.0, 0.56), (0.98, 0.98)),
        "left_tablet.ply": _slab((-0.83, 0.56), (0.58, 0.98)),
        "right_tablet.ply": _slab((0.83, 0.56), (0.58, 0.98)),
        "oak.ply": _frame(),
        "serpentine.ply": _serpentine(),
        "jasper.ply": _lying(
            stamp((0.40, 0.16, 0.36), ["T·LVCI", "NARDI"], ["STACTVM"], 150, 0.024, seed=37),
            (0.78, 0.0, 0.04),
        ),
        "clay.ply": _lying(
            stamp((0.46, 0.07, 0.30), ["IVCVN", "DIALE"], ["AES"], 150, -0.024, seed=41),
            (-0.76, 0.0, -0.12),
        ),
        "bronze.ply": joined(
            _lying(probe(0.70, 0.024), (-1.04, 0.035, 0.42)),
            _lying(spoon(0.80, 0.028), (-1.00, 0.035, 0.61)),
            _lying(scalpel(0.74, 0.026), (0.30, 0.035, 0.62)),
            _lying(tweezers(0.68, 0.028), (0.34, 0.035, 0.80)),
        ),
        "cards.ply": joined(_card((-0.70, 0.82), 0), _card((-0.13, 0.82), 1)),
        "warm.ply": plane((-1.95, -0.1, 1.0), (0, 0, -2.0), (0, 1.9, 0), (1, 1)),
        "cool.ply": plane((1.95, -0.1, -1.0), (0, 0, 2.0), (0, 1.9, 0), (1, 1)),
    }


def _serpentine() -> Mesh:
    """Return the great stamp, turned clockwise seen from above and tilted towards the camera."""
    letters = ["Q·VISI·PLANI", "LVCIDVM·AD", "CLARITATEM"]
    stone = stamp((0.66, 0.23, 0.54), letters, ["PLANI·CROC"], 140, 0.026, seed=31)
    # Turns by the triangle 7-24-25 need no sine: first about the vertical, then forwards.
    cosine, sine = 24 / 25, 7 / 25
    return placed(
        stone,
        (-0.04, 0.08, 0.02),
        (cosine, 0.0, sine),
        (-sine * sine, cosine, sine * cosine),
        (-cosine * sine, -sine, cosine * cosine),
    )


def _lying(mesh: Mesh, at: Vector) -> Mesh:
    """Return a mesh that is laid at a point, turned anticlockwise by the triangle 7-24-25."""
    cosine, sine = 24 / 25, 7 / 25
    return placed(mesh, at, (cosine, 0.0, -sine), (0.0, 1.0, 0.0), (sine, 0.0, cosine))


def _slab(centre: tuple[float, float], size: tuple[float, float]) -> Mesh:
    """Return a slab on the board; its face has the texture once, its edges a strip of it."""
    (x, y), (width, height), thick = centre, size, 0.05
    left, low, front = x - width / 2, y - height / 2, _BACK + thick
    return joined(
        plane((left, low, front), (width, 0, 0), (0, height, 0), (1, 1)),
        plane((left, low, _BACK), (0, 0, thick), (0, height, 0), (0.05, 1)),
        plane((left + width, low, front), (0, 0, -thick), (0, height, 0), (0.05, 1)),
        plane((left, low + height, front), (width, 0, 0), (0, 0, -thick), (1, 0.05)),
        plane((left, low, _BACK), (width, 0, 0), (0, 0, thick), (1, 0.05)),
    )


def _frame() -> Mesh:
    """Return the case's frame of oak: a rail in front, low sides, and a border about the board."""
    thick, outer = 0.16, _X + 0.16
    behind, before = _BACK - 0.02, _BACK + 0.14
    return joined(
        _bar((-outer, -0.3, _FRONT), (outer, 0.08, _FRONT + thick), 0),
        _bar((-outer, _TALL, behind), (outer, _TALL + thick, before), 0),
        _bar((-outer, -0.1, behind), (-_X, _TALL, before), 1),
        _bar((_X, -0.1, behind), (outer, _TALL, before), 1),
        _bar((-outer, -0.1, _BACK), (-_X, 0.08, _FRONT), 2),
        _bar((_X, -0.1, _BACK), (outer, 0.08, _FRONT), 2),
    )


def _bar(low: Vector, high: Vector, grain: int) -> Mesh:
    """Return a bar of oak between two corners, all but its back, its grain along an axis."""
    front, right, _, left, top, bottom = cuboid(low, high)
    return grained(quads(front, right, left, top, bottom), grain, _OAK)


def _card(at: tuple[float, float], number: int) -> Mesh:
    """Return a label that leans back; the labels are one above another in their texture."""
    card = plane((at[0], 0.012, at[1]), (0.26, 0, 0), (0, 0.058, -0.08), (1, 0.5))
    uvs = tuple((u, v + number / 2) for u, v in card.uvs)
    return Mesh(card.vertices, card.faces, uvs=uvs)
