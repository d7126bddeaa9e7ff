"""The bar: well exposed, lit from out of sight, and stocked with bottles that stand apart."""

from pathlib import Path

import pytest

from plateau.scenes.bar import build
from tests.scenes.support import facts

BAR = Path(build.__file__).parent


def test_it_is_well_exposed_at_ev_0():
    loaded = facts(BAR / "scene.xml", build.BRIGHT)
    assert loaded.median == pytest.approx(0.25, rel=0.15)
    assert loaded.clipped < 0.07  # the ceiling above the lamps, and highlights
