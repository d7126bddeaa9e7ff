"""A job's image with alpha, before its background, in whatever way its EXR is written."""

import numpy as np
import pytest
from playwright.sync_api import expect

from plateau.farm.images.exr import decode_layers
from plateau.metric import encode_srgb
from tests.page.conftest import Visit
from tests.page.job.test_job import pixels
from tests.support.farms.noise_farm import NoiseFarm

BACKGROUND = (0.5, 0.25, 1.0)
SPEC = {
    "step": 20,
    "slice_spp": 10,
    "max_spp": 20,
    "aovs": ["depth", "shape_id"],
    "view": {"background": BACKGROUND},
}


@pytest.mark.parametrize(
    ("precision", "compression"), [("float", "zip"), ("half", "zips"), ("half", "piz")]
)
def test_another_exposure_is_over_the_background_too(
    farm: NoiseFarm, visit: Visit, precision: str, compression: str
) -> None:
    farm.alpha = True
    job = farm.submit(**SPEC, exr={"precision": precision, "compression": compression})
    with farm.monitor():
        farm.finish(job)
    layers = decode_layers(farm.picture(job, "image.exr"))
    colour = np.stack([layers[name] for name in "RGB"], axis=-1)
    linear = colour + (1 - layers["A"][..., None]) * np.array(BACKGROUND, np.float32)
    page = visit(f"/jobs/{job.id}").page
    page.get_by_label("Exposure").fill("-1")
    canvas = page.locator("canvas.layer").first
    expect(canvas).to_be_visible()
    if compression == "piz":  # which the page does not read: it has the light of the picture
        linear = np.minimum(linear, 1)
    assert np.abs(pixels(canvas) - encode_srgb(linear, -1.0)).max() <= 1
