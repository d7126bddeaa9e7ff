"""What cannot go on with other channels of its film is refused in words."""

from pathlib import Path
from typing import Any

import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.images.exr import decode_layers
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from tests.service.api.routes.test_again import go_on, loses
from tests.support.farms.noise_farm import NoiseFarm

JOB = {"step": 20, "slice_spp": 10, "max_spp": 80, "rule": {"name": "fixed", "spp": 40}}


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit(**{**JOB, **spec})
    with farm.monitor():
        return farm.finish(job)


def continued(farm: NoiseFarm, job: Job, **changes: Any) -> Job:
    with farm.monitor():
        return farm.finish(go_on(farm, job, **changes))


def test_a_job_cannot_be_continued_with_other_aovs(farm: NoiseFarm) -> None:
    plain, rich = finished(farm), finished(farm, aovs=["depth"])
    assert loses(farm, plain, aovs=["depth"], max_spp=120) == "aovs"
    assert loses(farm, rich, aovs=["normal"], max_spp=120) == "aovs"


def test_a_job_whose_film_has_alpha_now_fails_in_words(farm: NoiseFarm) -> None:
    stopped = finished(farm)
    farm.alpha = True
    done = continued(farm, stopped, rule={"name": "fixed", "spp": 80})
    assert done.state is JobState.FAILED
    assert (
        "slice 4 has the channels R, G, B, W, A, those before it R, G, B, W: submit the scene as "
        "a new job"
    ) in done.reason
    # What it had before is still shown
    assert blobs.of_job(stopped.id) in farm.jobs.results(stopped.id)
    assert decode_layers(farm.picture(stopped, "image.exr")).keys() == {"R", "G", "B"}
