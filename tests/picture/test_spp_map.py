"""Where the samples of a job went that is allocated by zones: a picture beside its image."""

import io
from pathlib import Path

import numpy as np
import pytest
import redis
from numpy.typing import NDArray
from PIL import Image

from plateau.client import Client
from plateau.farm.images.exr import decode_layers
from plateau.farm.model.job import Job
from plateau.farm.wire import job_text
from plateau.metric.pictures import SAMPLES_PALETTE, samples_map
from plateau.rendering.outputs import write_results
from tests.support.farms.finished_jobs import finished
from tests.support.farms.live_api import live_api
from tests.support.farms.lopsided_farm import JOB, LopsidedFarm
from tests.support.farms.noise_farm import NoiseFarm


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return LopsidedFarm(client, redis_url, tmp_path, sigma=0.15)


def spp(farm: NoiseFarm, job: Job) -> NDArray[np.float32]:
    """The samples of each pixel, by the job's EXR."""
    return decode_layers(farm.picture(job, "image.exr"))["spp"]


def test_users_have_it_beside_the_image_and_read_its_ends(
    farm: NoiseFarm, redis_url: str, tmp_path: Path
) -> None:
    done = finished(farm, **JOB)
    # It shows what the EXR says, and names the ends of its scale
    with Image.open(io.BytesIO(farm.picture(done, "spp.png"))) as picture:
        texts, shown = dict(picture.info), np.asarray(picture.convert("RGB"))
    np.testing.assert_array_equal(shown, SAMPLES_PALETTE[samples_map(spp(farm, done))])
    assert texts["plateau:spp_min"] == str(done.spp_min)
    assert texts["plateau:spp_max"] == str(done.spp_max)
    assert texts["plateau:job"] == done.id
    # The noisy left is lighter than the calm right
    assert shown[:, :32].mean() > shown[:, 64:].mean()
    with live_api(redis_url, farm.store) as url, Client(url) as client:
        job = client.job(done.id)
        about = write_results(client, job, tmp_path / "out")
        np.testing.assert_array_equal(client.channels(job.id)["spp"], spp(farm, done))
        points = client.curve(job.id)
    assert (tmp_path / "out" / "spp.png").read_bytes() == farm.picture(done, "spp.png")
    ends = f"{done.spp_min:,} to {done.spp_max:,} spp"
    assert f"zones:      {ends}\n" in (tmp_path / "out" / "summary.txt").read_text()
    assert (about["spp_min"], about["spp_max"]) == (done.spp_min, done.spp_max)
    assert f"zones {ends}" in job_text.point_line(job, points[-1])
    # Of the first two points all zones have the same
    assert "zones" not in job_text.point_line(job, points[1])
