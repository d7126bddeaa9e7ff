"""A job with a focus is judged by the noise that is left where people look."""

import io
from pathlib import Path

import numpy as np
import pytest
import redis
from PIL import Image

from tests.support.farms.finished_jobs import finished
from tests.support.farms.noise_farm import NoiseFarm


def test_the_points_of_its_curve_count_what_is_looked_at(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    asked = {"step": 50, "max_spp": 100, "watch": [{"name": "visible"}]}
    asked["rule"] = {"name": "fixed", "spp": 100}
    plain, focused = (
        finished(farm, **asked, view={"focus": focus}) for focus in (None, [[0.5, 0.25]])
    )
    [_, last], [_, weighted] = (farm.jobs.curve(job.id) for job in (plain, focused))
    with Image.open(io.BytesIO(farm.picture(focused, "noise.png"))) as picture:
        red = np.asarray(picture.convert("RGB"))[..., 0]
    counts = (red == 255) + (red == 170) / 2
    left, right = np.split(counts, 2, axis=1)
    assert counts.sum() == last.estimate_pixels > 10
    expected = pytest.approx((left.sum() * 4 + right.sum() * 2) / 3)
    assert weighted.estimate_pixels == expected
    assert weighted.estimate_fraction == weighted.estimate_pixels / counts.size
    assert weighted.visible_pixels == last.visible_pixels
