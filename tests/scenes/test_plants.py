"""The plants: well exposed, and cut out by masks."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from plateau.scenes.mesh import Mesh
from plateau.scenes.plants import build
from plateau.scenes.plants.pictures import textures
from plateau.scenes.plants.planting import SUN, placements
from plateau.scenes.plants.sheets import Sheets, arching, blade, lathe, turned
from tests.scenes.support import facts

PLANTS = Path(build.__file__).parent


@pytest.mark.parametrize("intensity", [build.BRIGHT, build.DIM])
def test_it_is_well_exposed_and_every_plant_stands_in_it(intensity: float):
    meshes = {Path(name).stem: mesh for name, mesh in build.meshes().items()}
    copies = Counter(placement.plant for placement in placements())
    planted = {mesh: copies[plant] for plant, parts in build.PARTS.items() for mesh, _ in parts}

    loaded = facts(PLANTS / "scene.xml", intensity)

    assert loaded.median == pytest.approx(0.23 * intensity / build.BRIGHT, rel=0.15)
    assert loaded.clipped < 0.05
    assert loaded.faces == sum(
        planted.get(name, 1) * len(mesh.faces) for name, mesh in meshes.items()
    )
    # A JIT variant's speed hangs on it: the copies of a plant are one shape.
    assert sum(planted.values()) > 200
    assert loaded.shapes <= len(meshes)


@pytest.mark.parametrize("picture", ["frond", "ivy_leaf", "petals"])
def test_masks_cut_a_leaf_out_of_its_card(picture: str):
    mask = textures()[f"{picture}_mask.png"]
    middle = mask[:, mask.shape[1] // 2 - 2 : mask.shape[1] // 2 + 2]
    assert middle.max() == 1
    assert max(mask[0, 0], mask[0, -1], mask[-1, 0], mask[-1, -1]) == 0
    assert 0.2 < mask.mean() < 0.7


def test_no_bough_hangs_into_the_picture():
    bough = np.array(build.meshes()["bough.ply"].vertices)
    origin, target = np.array(build.EYE), np.array(build.TARGET)
    ahead = (target - origin) / math.dist(target, origin)
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    half = math.tan(math.radians(build.FIELD_OF_VIEW_DEG / 2))
    for placement in placements():
        if placement.plant == "bough":
            turn = turned(y_deg=placement.turn_deg) * placement.scale
            seen = bough @ turn.T + placement.at - origin
            depth, x, y = seen @ ahead, seen @ right, seen @ np.cross(right, ahead)
            inside = (depth > 0) & (np.abs(x) < half * depth) & (np.abs(y) < half * depth)
            assert not inside.any()


def test_the_suns_needles_are_as_far_apart_as_its_limb():
    first, *others = (np.array(direction) for direction in build.sun_directions())
    assert first == pytest.approx(-np.array(SUN))
    for other in others:
        apart = math.degrees(math.dist(first, other))
        assert apart == pytest.approx(build.SUN_RADIUS_DEG, rel=0.01)
    assert np.mean(others, axis=0) == pytest.approx(first)


def test_a_lathe_turns_a_closed_vessel_that_looks_outwards():
    sheets = Sheets()
    sheets.add(*lathe(((0.0, 0.0), (0.5, 0.0), (0.5, 2.0), (0.0, 2.0)), 64))
    assert _volume(sheets.mesh()) == pytest.approx(math.pi * 0.25 * 2, rel=0.01)


def _volume(mesh: Mesh) -> float:
    """Return the signed volume, by the divergence theorem: positive where faces look out."""
    a, b, c = np.array(mesh.vertices)[np.array(mesh.faces)].transpose(1, 0, 2)
    return float((a * np.cross(b, c)).sum() / 6)


def test_a_pointed_blade_ends_in_one_triangle_each_side():
    spine = arching(length=1.0, rise_deg=90, droop_deg=0, azimuth_deg=0, steps=4)
    assert spine.points[-1] == pytest.approx([0, 1, 0])
    sheets = Sheets()
    sheets.add(*blade(spine, lambda along: 0.1 * (1 - along)))
    mesh = sheets.mesh()
    assert len(mesh.faces) == 2 * (2 * 3 + 1)
    assert {corner for face in mesh.faces for corner in face} == set(range(len(mesh.vertices)))
