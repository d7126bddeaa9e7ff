"""Surfaces through rows of points: slabs with a relief, and bronze tubes."""

import math
from collections.abc import Sequence

from plateau.scenes.mesh import Face, Mesh, Vector
from plateau.scenes.oculist.lettering import Field


def _circle(count: int) -> list[tuple[float, float]]:
    """Return points of the unit circle, rounded to 1e-5, so that every machine has the same."""
    turns = (2 * math.pi * number / count for number in range(count))
    return [(round(math.cos(turn), 5), round(math.sin(turn), 5)) for turn in turns]


def plane(origin: Vector, right: Vector, up: Vector, repeat: tuple[float, float]) -> Mesh:
    """Return a parallelogram from its lower left corner; the texture repeats (across, up)."""
    a, b = origin, _at(origin, (right, 1))
    c, d = _at(b, (up, 1)), _at(origin, (up, 1))
    u, v = repeat
    return Mesh((a, b, c, d), ((0, 1, 2), (0, 2, 3)), uvs=((0, v), (u, v), (u, 0), (0, 0)))


def relief(
    heights: Field, origin: Vector, right: Vector, up: Vector, out: Vector, tile: float
) -> Mesh:
    """Return a rectangle that is raised along `out` by a field of heights.

    Parameters
    ----------
    heights : array (rows, columns), row 0 at the top
        In units of the length of `out`.
    origin : Vector
        The lower left corner.
    right, up : Vector
        The edges.
    out : Vector
        Away from the surface.
    tile : float
        Side of the texture's repeat, in units of the scene.
    """
    rows, columns = heights.shape
    across, along = _length(right) / tile, _length(up) / tile
    vertices: list[Vector] = []
    uvs: list[tuple[float, float]] = []
    for row in range(rows):
        for column in range(columns):
            u, v = column / (columns - 1), row / (rows - 1)
            raised = float(heights[row, column])
            vertices.append(_at(origin, (right, u), (up, 1 - v), (out, raised)))
            uvs.append((u * across, v * along))
    return Mesh(tuple(vertices), tuple(_faces(rows, columns, wrap=False)), uvs=tuple(uvs))


def tube(path: Sequence[Vector], radii: Sequence[tuple[float, float]], corners: int) -> Mesh:
    """Return a tube with an elliptical section along a path that stays near the horizontal.

    Parameters
    ----------
    path : sequence of Vector
        Middles of the sections.
    radii : sequence of (sideways, upwards)
        Half the width and half the height of each section.
    corners : int
        Corners of a section.
    """
    around = _circle(corners)
    vertices: list[Vector] = []
    for number, (middle, (half_width, half_height)) in enumerate(zip(path, radii, strict=True)):
        before, after = path[max(number - 1, 0)], path[min(number + 1, len(path) - 1)]
        ahead = _unit(_at(after, (before, -1)))
        side = _unit(_cross((0.0, 1.0, 0.0), ahead))
        top = _cross(ahead, side)
        vertices += [
            _at(middle, (side, half_width * cosine), (top, -half_height * sine))
            for cosine, sine in around
        ]
    return Mesh(tuple(vertices), tuple(_faces(len(path), corners, wrap=True)))


def placed(mesh: Mesh, origin: Vector, right: Vector, up: Vector, out: Vector) -> Mesh:
    """Return a mesh moved to an origin, its x, y and z axes turned to the three given."""
    vertices = tuple(_at(origin, (right, x), (up, y), (out, z)) for x, y, z in mesh.vertices)
    return Mesh(vertices, mesh.faces, uvs=mesh.uvs)


def _faces(rows: int, columns: int, *, wrap: bool) -> list[Face]:
    """Return two triangles for each cell, counter-clockwise where rows run down the outside."""
    faces: list[Face] = []
    for row in range(rows - 1):
        for column in range(columns if wrap else columns - 1):
            beside = (column + 1) % columns
            a, b = row * columns + column, row * columns + beside
            c, d = a + columns, b + columns
            faces += [(a, c, d), (a, d, b)]
    return faces


def _at(origin: Vector, *steps: tuple[Vector, float]) -> Vector:
    """Return the point so many times each vector away from a point."""
    x, y, z = origin
    for (dx, dy, dz), many in steps:
        x, y, z = x + dx * many, y + dy * many, z + dz * many
    return (x, y, z)


def _cross(p: Vector, q: Vector) -> Vector:
    return (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])


def _length(p: Vector) -> float:
    return math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])


def _unit(p: Vector) -> Vector:
    length = _length(p)
    return (p[0] / length, p[1] / length, p[2] / length)
