"""Surfaces of revolution: bottles, glasses, lamps and stools come off this lathe."""

import math
from collections.abc import Sequence
from itertools import pairwise

from plateau.scenes.mesh import Face, Mesh, Vector

#: A distance from the axis and a height.
Point = tuple[float, float]

#: Where a profile turns by more than this cosine allows it has an edge, which is not smoothed.
_EDGE_COSINE = 0.8


def circle(corners: int) -> list[Point]:
    """Return the corners of a regular polygon in the unit circle: 4, 6, or twice these, and so on.

    Halving angles by square roots gives every machine the same points.
    """
    half, side = math.sqrt(3) / 2, 0.5
    points: list[Point] = [(1, 0), (0, 1), (-1, 0), (0, -1)]
    if corners % 3 == 0:
        points = [(1, 0), (side, half), (-side, half), (-1, 0), (-side, -half), (side, -half)]
    while len(points) < corners:
        finer: list[Point] = []
        for (x, y), (u, v) in zip(points, points[1:] + points[:1], strict=True):
            length = math.sqrt((x + u) * (x + u) + (y + v) * (y + v))
            finer += [(x, y), ((x + u) / length, (y + v) / length)]
        points = finer
    if len(points) != corners:
        raise ValueError(f"no circle of {corners} corners by halving a square's or a hexagon's")
    return points


def rounded(profile: Sequence[Point]) -> list[Point]:
    """Return a profile with its corners cut (Chaikin); a point that is given twice stays sharp."""
    finer = [profile[0]]
    for (r, y), (s, z) in pairwise(profile):
        finer += [(0.75 * r + 0.25 * s, 0.75 * y + 0.25 * z)]
        finer += [(0.25 * r + 0.75 * s, 0.25 * y + 0.75 * z)]
    return [*finer, profile[-1]]


def turned(profile: Sequence[Point], corners: int, *, share: float = 1.0) -> Mesh:
    """Return what a profile sweeps about the vertical.

    Parameters
    ----------
    profile : sequence of (radius, height)
        Where it rises the surface looks away from the axis.
    corners : int
        Corners of the full circle.
    share : float
        How much of the full turn, the middle of it towards +z.
    """
    around = circle(corners)
    closed = share == 1.0
    if not closed:
        reach = round(corners * share / 2)
        around = [around[(corners // 4 + step) % corners] for step in range(-reach, reach + 1)]
    vertices: list[Vector] = []
    faces: list[Face] = []
    for strip in _smooth_strips(profile):
        below: list[int] = []
        for radius, height in strip:
            ring = [len(vertices)] * len(around)
            if radius > 0:
                ring = list(range(len(vertices), len(vertices) + len(around)))
                vertices += [(radius * x, height, radius * z) for x, z in around]
            else:
                vertices.append((0.0, height, 0.0))
            faces += _between(below, ring, closed=closed)
            below = ring
    return Mesh(tuple(vertices), tuple(faces))


def _smooth_strips(profile: Sequence[Point]) -> list[list[Point]]:
    """Return the profile cut at its edges, where a point belongs to both parts."""
    points = [point for point, next_one in pairwise(profile) if point != next_one] + [profile[-1]]
    strips = [points[:1]]
    for (r, y), point, (s, z) in zip(points, points[1:], points[2:], strict=False):
        strips[-1].append(point)
        behind, ahead = (point[0] - r, point[1] - y), (s - point[0], z - point[1])
        along = ahead[0] * behind[0] + ahead[1] * behind[1]
        if along < _EDGE_COSINE * math.sqrt(_square(ahead) * _square(behind)):
            strips.append([point])
    strips[-1].append(points[-1])
    return strips


def _square(step: Point) -> float:
    return step[0] * step[0] + step[1] * step[1]


def _between(below: list[int], above: list[int], *, closed: bool) -> list[Face]:
    """Return the triangles between two rings, less those without area at the axis."""
    faces: list[Face] = []
    if below:
        for here in range(len(below) if closed else len(below) - 1):
            there = (here + 1) % len(below)
            a, b, c, d = below[here], above[here], above[there], below[there]
            faces += [face for face in ((a, b, c), (a, c, d)) if len(set(face)) == 3]
    return faces
