"""The bar: well exposed, lit from out of sight, and stocked with bottles that stand apart."""

import math
from pathlib import Path

import numpy as np
import pytest

from scenes.bar import build, fittings, stock
from scenes.bar.stock import Copy
from tests.scenes.support import facts

BAR = Path(build.__file__).parent


@pytest.mark.parametrize("intensity", [build.BRIGHT, build.DIM])
def test_it_is_well_exposed_at_ev_0(intensity: float):
    loaded = facts(BAR / "scene.xml", intensity)
    assert loaded.median == pytest.approx(0.117 * intensity / build.BRIGHT, rel=0.2)
    assert loaded.clipped < 0.12  # the window, its image in the mirror, the lit shelves


def test_every_mesh_is_used():
    text = (BAR / "scene.xml").read_text()
    assert all(f"meshes/{name}" in text for name in build.meshes())


def test_the_lamps_show_themselves_to_the_ceiling_alone():
    eye = np.array(build.EYE)
    for lamp in stock.LAMPS:
        x, y, z = lamp
        # The disc lies inside the bowl, below its rim; the eye is below the rim as well.
        assert y + 0.085 < y + fittings.BOWL_HEIGHT
        assert eye[1] < y + fittings.BOWL_HEIGHT
        assert math.hypot(x - eye[0], z - eye[2]) > fittings.BOWL_RADIUS


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
