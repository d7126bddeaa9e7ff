"""Scenes as people have them: includes, relative meshes, textures, any filter, any film."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.farms.real_farm import RealFarm

ROOM = Path(__file__).parents[1] / "reference" / "scenes" / "room"


@pytest.mark.parametrize("rfilter", ["gaussian", "box"])
def test_a_scene_with_everything_is_rendered(staffed: RealFarm, rfilter: str) -> None:
    farm = staffed
    job = farm.submit(
        ROOM,
        parameters={"filter": rfilter, "width": 37},
        slice_spp=4,
        step=8,
        max_spp=16,
        rule={"name": "fixed", "spp": 16},
        watch=[{"name": "visible"}, {"name": "myszkowski"}],
    )
    done = farm.client.wait(job.id)
    assert (done.state, done.width, done.height, done.spp) == ("converged", 37, 24, 16)
    assert any("'multijitter' sampler was replaced by 'independent'" in note for note in done.notes)
    image = farm.image(done)
    assert image.shape == (24, 37, 3)
    assert np.isfinite(image).all()
    assert image.mean() > 0.05
    point = farm.client.curve(job.id)[-1]
    assert set(point.rules) == {"fixed", "visible", "myszkowski"}
    assert point.estimate_low_pixels <= point.estimate_pixels <= point.estimate_high_pixels
