"""A denoised image does not depend on who rendered it, nor on which monitor had it denoised."""

import numpy as np
import pytest

from plateau.farm.images.exr import decode_layers
from tests.acceptance.test_same_image import assert_same, kill_a_worker, kill_the_monitor, outcome
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.until import until

SPEC = {
    "parameters": {"width": 64, "height": 64},
    "denoise": {"name": "oidn"},
    "step": 40,
    "slice_spp": 10,
    "max_spp": 1200,
    "rule": {"name": "fixed", "spp": 240},
}


@pytest.mark.long
def test_workers_and_monitors_that_come_and_go_make_the_same_image(farm: RealFarm) -> None:
    # Given what one worker and one monitor make
    farm.start("monitor")
    farm.workers(1)
    alone = outcome(farm, farm.submit(BOX, **SPEC))
    farm.stop_all()
    # When there are three workers, of which one dies, and the monitor after it
    victims = {"monitor": [farm.start("monitor")], "worker": farm.workers(3)}
    until(lambda: len(farm.client.workers()) == 3)
    job = farm.submit(BOX, **SPEC)
    until(lambda: farm.client.job(job.id).points >= 1)
    kill_a_worker(farm, victims)
    kill_the_monitor(farm, victims)
    # Then all is the same, to the bit
    assert_same(outcome(farm, job), alone)
    found = decode_layers(farm.client.image(job.id, "image.exr"))
    assert {"raw.R", "denoised.R", "denoised.weight", "albedo.R", "N.X"} <= found.keys()
    raw, image = (np.stack([found[f"{layer}{c}"] for c in "RGB"]) for layer in ("raw.", ""))
    roughness = [np.abs(np.diff(one, axis=-1)).mean() for one in (image, raw)]
    assert roughness[0] < roughness[1]
