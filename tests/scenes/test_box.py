"""The box: its meshes are closed, and Mitsuba renders it well exposed."""

from pathlib import Path

import pytest

from plateau.scenes.box import build
from plateau.scenes.mesh import Mesh, Vector
from tests.scenes.support import facts

BOX = Path(build.__file__).parent


def volume(mesh: Mesh) -> float:
    """Six times the signed volume, by the divergence theorem: positive where faces look out."""

    def corner(index: int) -> Vector:
        return mesh.vertices[index]

    total = 0.0
    for i, j, k in mesh.faces:
        (a, b, c), (d, e, f), (g, h, m) = corner(i), corner(j), corner(k)
        total += a * (e * m - f * h) - b * (d * m - f * g) + c * (d * h - e * g)
    return total / 6


@pytest.mark.parametrize(
    ("name", "expected"), [("block.ply", 0.6 * 1.24 * 0.6), ("plinth.ply", 0.68 * 0.34 * 0.68)]
)
def test_blocks_are_closed_and_look_outwards(name: str, expected: float):
    assert volume(build.meshes()[name]) == pytest.approx(expected)


def test_the_ball_is_a_closed_sphere():
    ball = build.meshes()["ball.ply"]
    sphere = 4 / 3 * 3.14159265 * 0.27**3
    assert 0.95 * sphere < volume(ball) < sphere
    edges = {tuple(sorted(pair)) for i, j, k in ball.faces for pair in ((i, j), (j, k), (k, i))}
    assert len(ball.vertices) - len(edges) + len(ball.faces) == 2  # Euler
    assert ball.normals[0] == pytest.approx(
        [(x - c) / 0.27 for x, c in zip(ball.vertices[0], (0.5, 0.61, 0.22), strict=True)]
    )


@pytest.mark.parametrize("intensity", [build.BRIGHT, build.DIM])
def test_it_is_well_exposed_at_ev_0(intensity: float):
    loaded = facts(BOX / "scene.xml", intensity)
    assert loaded.median == pytest.approx(0.34 * intensity / build.BRIGHT, rel=0.15)
    assert loaded.clipped < 0.04  # the light itself covers 2 % of the image
