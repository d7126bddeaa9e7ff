"""By zones, the image does not depend on who rendered it either, whatever the filter."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.images.exr import decode_layers
from tests.acceptance.test_same_image import assert_same, kill_a_worker, outcome
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.until import until

SPEC = {
    "parameters": {"width": 64, "height": 64},
    "allocation": {"name": "zones", "size": 16},
    "step": 40,
    "slice_spp": 10,
    "max_spp": 1200,
    "rule": {"name": "fixed", "spp": 240},
}


def box_with(rfilter: str, folder: Path) -> Path:
    """The box, filtered otherwise."""
    shutil.copytree(BOX, folder / "box")
    scene = folder / "box" / "scene.xml"
    text = scene.read_text()
    scene.write_text(text.replace('<rfilter type="box"/>', f'<rfilter type="{rfilter}"/>'))
    return scene.parent


@pytest.mark.parametrize("rfilter", ["box", pytest.param("gaussian", marks=pytest.mark.long)])
def test_workers_that_come_and_go_make_the_same_image(
    farm: RealFarm, tmp_path: Path, rfilter: str
) -> None:
    scene = box_with(rfilter, tmp_path)
    # Given what one worker makes
    farm.start("monitor")
    farm.workers(1)
    alone = outcome(farm, farm.submit(scene, **SPEC))
    farm.stop_all()
    # When there are two, and one dies
    victims = {"monitor": [farm.start("monitor")], "worker": farm.workers(2)}
    until(lambda: len(farm.client.workers()) == 2)
    job = farm.submit(scene, **SPEC)
    until(lambda: farm.client.job(job.id).points >= 2)
    kill_a_worker(farm, victims)
    # Then all is the same
    assert_same(outcome(farm, job), alone)
    # And zones had what they needed
    spp = decode_layers(farm.client.image(job.id, "image.exr"))["spp"]
    assert spp.min() < spp.max()
    assert int(spp.mean(dtype=np.float64)) == alone[0].spp
    assert (spp.min(), spp.max()) == (alone[0].spp_min, alone[0].spp_max)
