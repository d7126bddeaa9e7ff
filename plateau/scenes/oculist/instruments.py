"""Instruments of bronze: a probe, a spoon, a scalpel and tweezers, each along x from 0."""

from collections.abc import Sequence

from plateau.scenes.mesh import Mesh, Vector, joined
from plateau.scenes.oculist.surfaces import tube

#: A section: where along the length (0 to 1), how high in lengths, half its width and half its
#: height in radii of the handle.
Section = tuple[float, float, float, float]

#: Sections in one bead of a handle.
_BEAD = 8
#: Where a handle has rings: at its ends and about its middle.
_RINGS = ((0.0, 0.16), (0.42, 0.58), (0.88, 1.0))


def probe(length: float, radius: float) -> Mesh:
    """Return a probe: a thin stem with an olive at its end."""
    return _turned(
        length,
        radius,
        beads=9,
        handle=0.45,
        end=(
            (0.47, 0.0, 0.5, 0.5),
            (0.70, 0.0, 0.36, 0.36),
            (0.86, 0.0, 0.32, 0.32),
            (0.88, 0.0, 0.55, 0.55),
            (0.91, 0.0, 0.95, 0.95),
            (0.95, 0.0, 1.1, 1.1),
            (0.98, 0.0, 0.8, 0.8),
            (0.999, 0.0, 0.3, 0.3),
        ),
    )


def spoon(length: float, radius: float) -> Mesh:
    """Return a spoon: a stem that rises and a shallow bowl."""
    return _turned(
        length,
        radius,
        beads=8,
        handle=0.40,
        end=(
            (0.46, 0.0, 0.5, 0.5),
            (0.62, 0.01, 0.42, 0.42),
            (0.70, 0.02, 0.6, 0.42),
            (0.74, 0.022, 1.6, 0.4),
            (0.79, 0.015, 2.5, 0.35),
            (0.84, 0.010, 3.0, 0.3),
            (0.90, 0.010, 3.0, 0.3),
            (0.95, 0.015, 2.4, 0.3),
            (0.98, 0.020, 1.5, 0.3),
            (0.999, 0.024, 0.3, 0.2),
        ),
    )


def scalpel(length: float, radius: float) -> Mesh:
    """Return a scalpel: a blade in the shape of a leaf."""
    return _turned(
        length,
        radius,
        beads=10,
        handle=0.50,
        end=(
            (0.52, 0.0, 0.75, 0.75),
            (0.58, 0.0, 0.75, 0.65),
            (0.62, 0.0, 1.7, 0.4),
            (0.70, 0.0, 2.7, 0.33),
            (0.80, 0.0, 2.9, 0.27),
            (0.90, 0.0, 2.2, 0.22),
            (0.97, 0.0, 1.0, 0.16),
            (0.999, 0.0, 0.1, 0.05),
        ),
    )


def tweezers(length: float, radius: float) -> Mesh:
    """Return tweezers: two bent strips that meet at one end, and the ring that slides on them."""
    # Where along, how far to the side and half how high, in radii.
    bend = (
        (0.001, 0.3, 0.9),
        (0.03, 1.1, 0.9),
        (0.10, 0.8, 1.0),
        (0.25, 1.5, 1.0),
        (0.45, 2.1, 1.1),
        (0.65, 2.3, 1.1),
        (0.80, 2.1, 0.9),
        (0.93, 1.4, 0.6),
        (0.99, 0.6, 0.5),
    )

    def strip(side: float) -> Mesh:
        path = [(length * along, 0.0, side * radius * away) for along, away, _ in bend]
        return _closed(path, [(radius * 0.32, radius * high) for *_, high in bend], corners=8)

    ring = _closed(
        [(length * along, 0.0, 0.0) for along in (0.2, 0.215, 0.23)],
        [(radius * half_width, radius * 0.8 * half_width) for half_width in (2.0, 2.3, 2.0)],
    )
    return joined(strip(1.0), strip(-1.0), ring)


def _turned(
    length: float, radius: float, beads: int, handle: float, end: Sequence[Section]
) -> Mesh:
    """Return an instrument: a handle turned on a lathe, so many beads long, and its working end."""
    sections: list[Section] = []
    for number in range(beads * _BEAD + 1):
        part = number / (beads * _BEAD)
        in_bead = 2 * (number % _BEAD) / _BEAD - 1
        swell = 0.55 if any(low <= part <= high for low, high in _RINGS) else 0.12
        half = 0.75 + swell * (1 - in_bead * in_bead)
        sections.append((handle * part, 0.0, half, half))
    sections += end
    return _closed(
        [(length * along, length * lift, 0.0) for along, lift, _, _ in sections],
        [(radius * wide, radius * high) for _, _, wide, high in sections],
    )


def _closed(path: list[Vector], radii: list[tuple[float, float]], corners: int = 12) -> Mesh:
    """Return a tube whose ends are drawn together, all but to a point."""
    point = (1e-4, 1e-4)
    first, last = path[0], path[-1]
    return tube(
        [(first[0] - 1e-3, *first[1:]), *path, (last[0] + 1e-3, *last[1:])],
        [point, *radii, point],
        corners,
    )
