"""The bar: well exposed, lit from out of sight, and stocked with bottles that stand apart."""

import math
from pathlib import Path

import numpy as np
import pytest

from plateau.scenes.bar import build, fittings, stock
from plateau.scenes.bar.stock import Copy
from tests.scenes.support import facts

BAR = Path(build.__file__).parent


@pytest.mark.parametrize("intensity", [build.BRIGHT, build.DIM])
def test_it_is_well_exposed_at_ev_0(intensity: float):
    loaded = facts(BAR / "scene.xml", intensity)
    assert loaded.median == pytest.approx(0.25 * intensity / build.BRIGHT, rel=0.15)
    assert loaded.clipped < 0.07  # the ceiling above the lamps, and highlights


def test_every_mesh_is_used():
    text = (BAR / "scene.xml").read_text()
    assert all(f"meshes/{name}" in text for name in build.meshes())


def test_lamps_and_coves_shine_at_the_ceiling_alone():
    made = build.meshes()
    for name in ("filaments.ply", "coves.ply"):
        mesh = made[name]
        corners = np.array(mesh.vertices)[np.array(mesh.faces)]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (normals[:, 1] > 0).all()
        assert normals[:, [0, 2]] == pytest.approx(0)
        assert corners[..., 1].min() > build.EYE[1]
    # A bowl hides its disc, which lies a little below the rim.
    discs = np.array(made["filaments.ply"].vertices).reshape(len(stock.LAMPS), -1, 3)
    for (x, y, z), disc in zip(stock.LAMPS, discs, strict=True):
        assert (disc[:, 1] < y + fittings.BOWL_HEIGHT).all()
        assert (np.hypot(disc[:, 0] - x, disc[:, 2] - z) < fittings.BOWL_RADIUS).all()


def test_bottles_stand_on_their_shelves_without_touching():
    bottles = [
        copy
        for copies in stock.stock(seed=4).values()
        for copy in copies
        if copy.mesh.endswith("_glass")
    ]
    assert len(bottles) > 40
    radius = {
        name: max(math.hypot(x, z) for x, _, z in mesh.vertices)
        for name, mesh in build.meshes().items()
    }

    def reach(copy: Copy) -> float:
        return radius[f"{copy.mesh}.ply"] * copy.scale

    for number, one in enumerate(bottles):
        for other in bottles[number + 1 :]:
            if one.at[1] == other.at[1]:
                assert math.dist(one.at, other.at) > reach(one) + reach(other)
