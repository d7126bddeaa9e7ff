"""OCULIST: well exposed, and covered with fine texture and real relief."""

from pathlib import Path

import pytest

from plateau.scenes.oculist import build
from plateau.scenes.oculist.case import meshes
from tests.scenes.support import facts

OCULIST = Path(build.__file__).parent
TEXTURED = ("cloth", "mosaic", "left_tablet", "right_tablet", "frieze")


def test_it_is_well_exposed_at_ev_0():
    loaded = facts(OCULIST / "scene.xml", build.BRIGHT)
    assert loaded.median == pytest.approx(0.28, rel=0.15)
    assert loaded.clipped < 0.05
    lights = 3 * 2
    assert loaded.faces == lights + sum(len(mesh.faces) for mesh in meshes().values()) < 100_000
