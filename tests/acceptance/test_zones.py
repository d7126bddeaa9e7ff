"""Zones and denoised images do not depend on who rendered them, nor on who died on the way."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plateau.farm.images.exr import decode_layers
from tests.acceptance.test_same_image import assert_same, outcome
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.long_tests import rare

SPEC = {
    "parameters": {"width": 48, "height": 48},
    "step": 40,
    "slice_spp": 10,
    "max_spp": 1200,
    "rule": {"name": "fixed", "spp": 240},
}
ZONES = {"allocation": {"name": "zones", "size": 16}}
DENOISED = {"denoise": {"name": "oidn"}}


def box_with(rfilter: str, folder: Path) -> Path:
    """The box, filtered otherwise."""
    shutil.copytree(BOX, folder / "box")
    scene = folder / "box" / "scene.xml"
    text = scene.read_text()
    scene.write_text(text.replace('<rfilter type="box"/>', f'<rfilter type="{rfilter}"/>'))
    return scene.parent


@pytest.mark.parametrize(
    ("rfilter", "how"), [("box", ZONES), ("box", DENOISED), *rare(("gaussian", ZONES))]
)
def test_workers_and_monitors_that_come_and_go_make_the_same_image(
    farm: RealFarm, tmp_path: Path, rfilter: str, how: dict[str, Any]
) -> None:
    scene, monitor = box_with(rfilter, tmp_path), farm.start("monitor")
    victim, _ = farm.workers(2)
    # Given what comes of the job where nothing happens
    alone = outcome(farm, farm.submit(scene, **SPEC, **how))
    # When a worker dies, and the monitor after it
    job = farm.client.job(farm.submit_half_way(scene, **SPEC, **how))
    farm.kill(victim)
    farm.workers(1)
    farm.kill(monitor)
    farm.start("monitor")
    # Then all is the same, to the bit
    assert_same(outcome(farm, job), alone)
    found = decode_layers(farm.client.image(job.id, "image.exr"))
    if how is ZONES:  # which had what they needed
        spp = found["spp"]
        assert spp.min() < spp.max()
        assert int(spp.mean(dtype=np.float64)) == alone[0].spp
        assert (spp.min(), spp.max()) == (alone[0].spp_min, alone[0].spp_max)
    else:
        layers = {"raw.R", "denoised.R", "denoised.weight", "albedo.R", "N.X"}
        assert layers <= found.keys()
        raw, image = (np.stack([found[f"{layer}{c}"] for c in "RGB"]) for layer in ("raw.", ""))
        assert not np.array_equal(raw, image)
