"""Curved sheets: what leaves, petals and pots are made of.

A sheet is a grid of points with a texture coordinate each. Sines go into these vertices, and
machines round those differently in the last bit; so vertices are rounded to 1e-5 (a hundredth of
a millimetre) before they are written, and every machine builds the same bytes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from plateau.scenes.mesh import Face, Mesh

#: Numbers of any shape whose last axis holds x, y, z or u, v.
Points = NDArray[np.float64]

_DECIMALS = 5


@dataclass
class Sheets:
    """Sheets that make one mesh together; neighbours in a sheet share vertices, so it is smooth."""

    points: list[Points] = field(default_factory=list)
    uvs: list[Points] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)

    def add(self, points: Points, uvs: Points) -> None:
        """Add a sheet.

        Parameters
        ----------
        points : (R, C, 3)
            Its vertices; triangles without area, as at a pointed tip, are left out.
        uvs : (R, C, 2)
            Their texture coordinates.
        """
        first = sum(len(part) for part in self.points)
        rows, columns = points.shape[:2]
        flat = np.round(points.reshape(-1, 3), _DECIMALS)
        for row in range(rows - 1):
            for column in range(columns - 1):
                a = row * columns + column
                b, c, d = a + 1, a + columns + 1, a + columns
                for triangle in ((a, b, c), (a, c, d)):
                    if _has_area(flat[list(triangle)]):
                        self.faces.append(tuple(first + corner for corner in triangle))
        self.points.append(flat)
        self.uvs.append(np.round(uvs.reshape(-1, 2), _DECIMALS))

    def place(self, other: "Sheets", turn: Points, at: Sequence[float]) -> None:
        """Add all of another's sheets, turned by a 3x3 matrix (which may scale) and moved."""
        first = sum(len(part) for part in self.points)
        for points, uvs in zip(other.points, other.uvs, strict=True):
            self.points.append(np.round(points @ turn.T + np.asarray(at), _DECIMALS))
            self.uvs.append(uvs)
        self.faces += [tuple(first + corner for corner in face) for face in other.faces]

    def mesh(self) -> Mesh:
        """Return the sheets as one mesh, less the vertices that no face needs."""
        needed = sorted({corner for face in self.faces for corner in face})
        renumbered = {corner: index for index, corner in enumerate(needed)}
        points = np.concatenate(self.points)[needed].tolist()
        uvs = np.concatenate(self.uvs)[needed].tolist()
        return Mesh(
            tuple((x, y, z) for x, y, z in points),
            tuple(tuple(renumbered[corner] for corner in face) for face in self.faces),
            uvs=tuple((u, v) for u, v in uvs),
        )


def _has_area(corners: Points) -> bool:
    a, b, c = corners
    return float(np.linalg.norm(np.cross(b - a, c - a))) > 1e-9


@dataclass(frozen=True)
class Spine:
    """A curve with a frame at each of its points, all (N, 3); `along` is 0 to 1, (N,)."""

    along: Points
    points: Points
    sides: Points
    normals: Points


def arching(
    length: float, rise_deg: float, droop_deg: float, azimuth_deg: float, steps: int
) -> Spine:
    """Return a spine from the origin that sets out at a rise and droops as it goes."""
    along = np.linspace(0.0, 1.0, steps + 1)
    angle = np.radians(rise_deg - droop_deg * along**1.4)
    middle = (angle[1:] + angle[:-1]) / 2
    reach = np.concatenate([[0.0], np.cumsum(np.cos(middle))]) * length / steps
    height = np.concatenate([[0.0], np.cumsum(np.sin(middle))]) * length / steps
    azimuth = math.radians(azimuth_deg)
    outwards = np.array([math.cos(azimuth), 0.0, -math.sin(azimuth)])
    side = np.array([math.sin(azimuth), 0.0, math.cos(azimuth)])
    up = np.array([0.0, 1.0, 0.0])
    return Spine(
        along,
        reach[:, None] * outwards + height[:, None] * up,
        np.broadcast_to(side, (steps + 1, 3)),
        np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * outwards,
    )


def blade(
    spine: Spine,
    half_width: Callable[[Points], Points],
    *,
    fold_deg: float = 20.0,
    columns: int = 3,
    cut_out: bool = False,
) -> tuple[Points, Points]:
    """Return a leaf's points and texture coordinates along a spine, folded up at its midrib.

    Parameters
    ----------
    spine : Spine
        The midrib.
    half_width : function of (N,) in 0 to 1
        Half the width at each point along.
    fold_deg : float
        How far each half is turned up.
    columns : int
        Vertices across, odd.
    cut_out : bool
        Whether the texture is a picture of the whole leaf, out of which the blade is cut; else it
        is stretched over the width, and its left and right edges follow the leaf's.
    """
    width = half_width(spine.along)
    across = np.linspace(-1.0, 1.0, columns)
    fold = math.radians(fold_deg)
    points = (
        spine.points[:, None]
        + (across[None, :] * width[:, None] * math.cos(fold))[..., None] * spine.sides[:, None]
        + (across[None, :] ** 2 * width[:, None] * math.sin(fold))[..., None]
        * spine.normals[:, None]
    )
    share = width / width.max() if cut_out else np.ones_like(width)
    u = 0.5 + 0.5 * across[None, :] * share[:, None]
    v = np.broadcast_to(spine.along[:, None], u.shape)
    return points, np.stack([u, v], axis=-1)


def lathe(profile: Sequence[tuple[float, float]], segments: int) -> tuple[Points, Points]:
    """Return a surface of revolution about the vertical from its (radius, height) pairs.

    Seen from outside, faces run counter-clockwise where the profile rises.
    """
    radius, height = np.array(profile, dtype=np.float64).T
    angle = np.linspace(0.0, 2 * math.pi, segments + 1)
    angle[-1] = 0.0  # so that the seam closes to the last bit
    points = np.stack(
        [
            radius[:, None] * np.cos(angle),
            np.broadcast_to(height[:, None], (len(radius), segments + 1)),
            -radius[:, None] * np.sin(angle),
        ],
        axis=-1,
    )
    run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(radius), np.diff(height)))])
    u, v = np.meshgrid(np.linspace(0.0, 1.0, segments + 1), run / run[-1])
    return points, np.stack([u, v], axis=-1)


def turned(*, x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0) -> Points:
    """Return the matrix that turns about x, then z, then y."""
    return _about(1, y_deg) @ _about(2, z_deg) @ _about(0, x_deg)


def _about(axis: int, angle_deg: float) -> Points:
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    following, last = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[following, following] = matrix[last, last] = cosine
    matrix[following, last], matrix[last, following] = -sine, sine
    return matrix
