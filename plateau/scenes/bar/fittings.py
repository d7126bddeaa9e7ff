"""What is of metal and leather: lamps, stools, the rail for feet, the tap. Lengths in metres."""

from collections.abc import Sequence

from plateau.scenes.bar.turning import rounded, turned
from plateau.scenes.mesh import Mesh, Vector, joined

#: A lamp's bowl: its rim's radius and height above the bowl's foot.
BOWL_RADIUS, BOWL_HEIGHT = 0.19, 0.11


def bowl() -> Mesh:
    """Return a bowl that keeps its light from all below: outside, rim and inside."""
    outside = ((0, 0), (0.03, 0), (0.11, 0.018), (0.17, 0.06), (BOWL_RADIUS, BOWL_HEIGHT))
    inside = tuple((radius * 0.985, height + 0.003) for radius, height in reversed(outside))
    knob = ((0, -0.03), (0.010, -0.028), (0.012, -0.018), (0.006, -0.008), (0.012, 0.0))
    return turned([*rounded(knob), *rounded(outside)[1:], *rounded(inside)], 48)


def filaments(lamps: Sequence[Vector]) -> Mesh:
    """Return the discs of light just below the rims of lamps' bowls, which face the ceiling."""
    disc = turned([(0.18, BOWL_HEIGHT - 0.004), (0, BOWL_HEIGHT - 0.004)], 24)
    return joined(
        *(
            Mesh(tuple((x + u, y + v, z + w) for u, v, w in disc.vertices), disc.faces)
            for x, y, z in lamps
        )
    )


def rod(radius: float, length: float, corners: int = 12) -> Mesh:
    """Return an upright rod with flat ends."""
    return turned([(0, 0), (radius, 0), (radius, length), (0, length)], corners)


def cushion() -> Mesh:
    """Return a stool's seat of leather, from 0.70 to 0.78 above the floor."""
    side = ((0.165, 0.700), (0.165, 0.700), (0.182, 0.705), (0.186, 0.735), (0.180, 0.768))
    return turned(rounded(((0, 0.700), *side, (0.130, 0.785), (0, 0.780))), 48)


def pedestal() -> Mesh:
    """Return all of a stool but its seat: foot, column, ring for feet, and plate."""
    foot = ((0, 0), (0.200, 0), (0.200, 0), (0.200, 0.012), (0.190, 0.018), (0.060, 0.030))
    column = ((0.026, 0.050), (0.022, 0.090), (0.022, 0.620), (0.030, 0.660), (0.150, 0.690))
    return turned(rounded((*foot, *column, (0.168, 0.690), (0.168, 0.702), (0.168, 0.702))), 32)


def band() -> Mesh:
    """Return the ring of metal about a seat's lower edge."""
    return turned(rounded(((0.184, 0.700), (0.190, 0.706), (0.190, 0.718), (0.184, 0.724))), 48)


def ring(radius: float, thickness: float) -> Mesh:
    """Return a ring that lies flat."""
    section = ((0, -1), (1, -1), (1, 1), (-1, 1), (-1, -1), (0, -1))
    profile = [(radius + thickness * out, thickness * up) for out, up in section]
    return turned(rounded(rounded(profile)), 32)


def tap() -> Mesh:
    """Return the column of a beer tap."""
    foot = ((0, 0), (0.070, 0), (0.070, 0), (0.070, 0.010), (0.050, 0.022), (0.034, 0.050))
    column = ((0.030, 0.120), (0.030, 0.290), (0.030, 0.290), (0.040, 0.296), (0.040, 0.312))
    dome = ((0.038, 0.318), (0.034, 0.345), (0.018, 0.362), (0, 0.365))
    return turned(rounded((*foot, *column, *dome)), 32)
