"""The box: its meshes are closed, and Mitsuba renders it well exposed."""

from pathlib import Path

import pytest

from plateau.scenes.box import build
from tests.scenes.support import facts

BOX = Path(build.__file__).parent


def test_it_is_well_exposed_at_ev_0():
    loaded = facts(BOX / "scene.xml", build.BRIGHT)
    assert loaded.median == pytest.approx(0.34, rel=0.15)
    assert loaded.clipped < 0.04  # the light itself covers 2 % of the image
