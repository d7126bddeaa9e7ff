"""Small meshes, and how they are written as binary PLY.

Only sums, products and square roots go into a vertex, all of which IEEE 754 rounds in one way, so
that every machine builds the same bytes.
"""

import math
import struct
from dataclasses import dataclass

Vector = tuple[float, float, float]
Face = tuple[int, ...]
Quad = tuple[Vector, Vector, Vector, Vector]


@dataclass(frozen=True)
class Mesh:
    """Vertices, faces that run counter-clockwise seen from outside, and normals where smooth.

    Without normals Mitsuba makes smooth ones of its own wherever faces share a vertex.
    """

    vertices: tuple[Vector, ...]
    faces: tuple[Face, ...]
    normals: tuple[Vector, ...] = ()
    #: texture coordinates, where a texture is wanted
    uvs: tuple[tuple[float, float], ...] = ()

    def to_ply(self) -> bytes:
        """Return the mesh as little-endian binary PLY."""
        properties = ["x", "y", "z"] + (["nx", "ny", "nz"] if self.normals else [])
        properties += ["u", "v"] if self.uvs else []
        header = "\n".join(
            [
                "ply",
                "format binary_little_endian 1.0",
                f"element vertex {len(self.vertices)}",
                *(f"property float {name}" for name in properties),
                f"element face {len(self.faces)}",
                "property list uchar int vertex_indices",
                "end_header\n",
            ]
        )
        absent = ((),) * len(self.vertices)
        rows = [
            struct.pack(f"<{len(properties)}f", *vertex, *normal, *uv)
            for vertex, normal, uv in zip(
                self.vertices, self.normals or absent, self.uvs or absent, strict=True
            )
        ]
        rows += [struct.pack(f"<B{len(face)}i", len(face), *face) for face in self.faces]
        return header.encode("ascii") + b"".join(rows)


def quads(*corners: Quad) -> Mesh:
    """Return flat rectangles, each by its four corners; they share no vertex."""
    vertices = tuple(corner for quad in corners for corner in quad)
    faces = tuple(
        triangle
        for first in range(0, len(vertices), 4)
        for triangle in ((first, first + 1, first + 2), (first, first + 2, first + 3))
    )
    return Mesh(vertices, faces)


def joined(*meshes: Mesh) -> Mesh:
    """Return meshes as one; all of them have normals or none, and texture coordinates or none."""
    faces: list[Face] = []
    first = 0
    for mesh in meshes:
        faces += [tuple(first + corner for corner in face) for face in mesh.faces]
        first += len(mesh.vertices)
    return Mesh(
        tuple(vertex for mesh in meshes for vertex in mesh.vertices),
        tuple(faces),
        tuple(normal for mesh in meshes for normal in mesh.normals),
        tuple(uv for mesh in meshes for uv in mesh.uvs),
    )


def sides(bottom: Quad, top: Quad) -> tuple[Quad, Quad, Quad, Quad, Quad, Quad]:
    """Return the front, right, back, left, top and bottom of a block, facing out.

    The corners of its bottom and of its top run counter-clockwise seen from above, from the front
    left one on.
    """
    a, b, c, d = bottom
    e, f, g, h = top
    return (a, b, f, e), (b, c, g, f), (c, d, h, g), (d, a, e, h), top, (d, c, b, a)


def cuboid(low: Vector, high: Vector) -> tuple[Quad, Quad, Quad, Quad, Quad, Quad]:
    """Return the `sides` of the cuboid along the axes between two corners."""
    (left, bottom, back), (right, top, front) = low, high

    def level(y: float) -> Quad:
        return (left, y, front), (right, y, front), (right, y, back), (left, y, back)

    return sides(level(bottom), level(top))


def grained(mesh: Mesh, axis: int, repeat: tuple[float, float]) -> Mesh:
    """Return faces that lie along the axes with a texture whose grain runs along one of them.

    Parameters
    ----------
    mesh
        Without texture coordinates.
    axis
        Along the grain.
    repeat
        Lengths of the texture along and across the grain.
    """
    # On each face one of the two coordinates across the grain is constant.
    uvs = tuple(
        (vertex[axis] / repeat[0], (sum(vertex) - vertex[axis]) / repeat[1])
        for vertex in mesh.vertices
    )
    return Mesh(mesh.vertices, mesh.faces, uvs=uvs)


def block(centre: tuple[float, float], size: Vector, turn: tuple[float, float]) -> Mesh:
    """Return a cuboid that stands on the floor.

    Parameters
    ----------
    centre : (x, z)
        Where it stands.
    size : (width, height, depth)
        Its edges.
    turn : (cosine, sine)
        How far it is turned about the vertical.
    """
    cosine, sine = turn
    half_width, height, half_depth = size[0] / 2, size[1], size[2] / 2

    def corner(x: int, y: int, z: int) -> Vector:
        along, across = x * half_width, z * half_depth
        return (
            centre[0] + cosine * along + sine * across,
            y * height,
            centre[1] - sine * along + cosine * across,
        )

    def level(y: int) -> Quad:
        return corner(-1, y, 1), corner(1, y, 1), corner(1, y, -1), corner(-1, y, -1)

    return quads(*sides(level(0), level(1)))


def ball(centre: Vector, radius: float, subdivisions: int) -> Mesh:
    """Return a sphere of triangles with smooth normals: an icosahedron, subdivided."""
    golden = (1 + math.sqrt(5)) / 2
    points: list[Vector] = []
    for one in (-1.0, 1.0):
        for phi in (-golden, golden):
            points += [(0.0, one, phi), (one, phi, 0.0), (phi, 0.0, one)]
    points = [_unit(point) for point in points]
    faces = _icosahedron_faces(points)
    for _ in range(subdivisions):
        faces = _subdivide(points, faces)
    vertices = tuple(
        (
            centre[0] + radius * point[0],
            centre[1] + radius * point[1],
            centre[2] + radius * point[2],
        )
        for point in points
    )
    return Mesh(vertices, tuple(faces), tuple(points))


def _icosahedron_faces(points: list[Vector]) -> list[Face]:
    """Return all triples of neighbours, turned outwards."""
    count = len(points)
    near = [[_dot(points[i], points[j]) > 0.4 for j in range(count)] for i in range(count)]
    faces: list[Face] = []
    for i in range(count):
        for j in range(i + 1, count):
            for k in range(j + 1, count):
                if near[i][j] and near[j][k] and near[k][i]:
                    outwards = _dot(points[i], _cross(points[j], points[k])) > 0
                    faces.append((i, j, k) if outwards else (i, k, j))
    return faces


def _subdivide(points: list[Vector], faces: list[Face]) -> list[Face]:
    """Return each face as four, having added the middles of its edges to the points."""
    middles: dict[tuple[int, int], int] = {}

    def middle(i: int, j: int) -> int:
        edge = (min(i, j), max(i, j))
        if edge not in middles:
            p, q = points[edge[0]], points[edge[1]]
            middles[edge] = len(points)
            points.append(_unit((p[0] + q[0], p[1] + q[1], p[2] + q[2])))
        return middles[edge]

    finer: list[Face] = []
    for i, j, k in faces:
        ij, jk, ki = middle(i, j), middle(j, k), middle(k, i)
        finer += [(i, ij, ki), (ij, j, jk), (ki, jk, k), (ij, jk, ki)]
    return finer


def _dot(p: Vector, q: Vector) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _cross(p: Vector, q: Vector) -> Vector:
    return (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])


def _unit(p: Vector) -> Vector:
    length = math.sqrt(_dot(p, p))
    return (p[0] / length, p[1] / length, p[2] / length)
