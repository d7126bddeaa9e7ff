"""The plants: well exposed, and cut out by masks."""

from collections import Counter
from pathlib import Path

import pytest

from plateau.scenes.plants import build
from plateau.scenes.plants.planting import placements
from tests.scenes.support import facts

PLANTS = Path(build.__file__).parent


def test_it_is_well_exposed_and_every_plant_stands_in_it():
    meshes = {Path(name).stem: mesh for name, mesh in build.meshes().items()}
    copies = Counter(placement.plant for placement in placements())
    planted = {mesh: copies[plant] for plant, parts in build.PARTS.items() for mesh, _ in parts}

    loaded = facts(PLANTS / "scene.xml", build.BRIGHT)

    assert loaded.median == pytest.approx(0.23, rel=0.15)
    assert loaded.clipped < 0.05
    assert loaded.faces == sum(
        planted.get(name, 1) * len(mesh.faces) for name, mesh in meshes.items()
    )
    # A JIT variant's speed hangs on it: the copies of a plant are one shape.
    assert sum(planted.values()) > 200
    assert loaded.shapes <= len(meshes)
