"""The box: what is checked in is what the code builds, and Mitsuba renders it well exposed."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from farm.bundle import inspect_bundle
from plateau.packing import pack
from scenes.box import build
from scenes.mesh import Mesh, Vector

BOX = Path(build.__file__).parent


def test_the_files_checked_in_are_what_the_code_builds():
    built = build.files()
    for name, content in built.items():
        assert (BOX / name).read_bytes() == content, f"run python -m scenes.box.build: {name}"
    assert {path.name for path in (BOX / "meshes").iterdir()} == {
        Path(name).name for name in built if name.startswith("meshes/")
    }


def test_it_builds_elsewhere_too(tmp_path: Path):
    build.write(tmp_path)
    assert (tmp_path / "meshes" / "ball.ply").read_bytes() == (
        BOX / "meshes" / "ball.ply"
    ).read_bytes()


def test_it_passes_the_farms_check():
    with pack(BOX / "scene.xml") as packed:
        summary = inspect_bundle(packed.file, parameters={"width": "128", "intensity": "10"})
    assert (summary.entry, summary.sensors, summary.files) == ("scene.xml", 1, 7)
    assert (summary.width, summary.height) == (128, 256)
    assert summary.parameters == {
        "width": "256",
        "height": "256",
        "intensity": "20",
        "max_depth": "8",
    }


def test_the_readme_names_both_intensities():
    readme = (BOX.parent / "README.md").read_text(encoding="utf-8")
    assert f"| BOX 1 | {build.BRIGHT:g} |" in readme
    assert f"| BOX 2 | {build.DIM:g} |" in readme


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


_RENDER = """
import json, sys
import mitsuba as mi, numpy as np
mi.set_variant("scalar_rgb")
scene = mi.load_file(sys.argv[1], width=32, height=32, intensity=sys.argv[2])
brightest = np.array(mi.render(scene, spp=64)).max(axis=2)
print("\\n" + json.dumps([float(np.median(brightest)), float((brightest > 1).mean())]))
"""


@pytest.mark.parametrize(("intensity", "factor"), [(build.BRIGHT, 1.0), (build.DIM, 0.5)])
def test_it_is_well_exposed_at_ev_0(intensity: float, factor: float):
    process = subprocess.run(
        [sys.executable, "-c", _RENDER, str(BOX / "scene.xml"), str(intensity)],
        capture_output=True,
        text=True,
        check=True,
    )
    median, clipped = json.loads(process.stdout.splitlines()[-1])
    assert median == pytest.approx(0.34 * factor, rel=0.15)
    assert clipped < 0.04  # the light itself covers 2 % of the image
