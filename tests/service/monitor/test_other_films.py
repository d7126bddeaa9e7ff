"""What cannot go on with other channels of its film is refused in words."""

from pathlib import Path
from typing import Any

import pytest
import redis

from plateau.farm.blobs import store as blobs
from plateau.farm.images.exr import decode_layers
from plateau.farm.ledger.continuation import Continuations, changed_spec, check
from plateau.farm.model.errors import CannotContinue
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
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
    continuations = Continuations(farm.jobs._redis)
    remains = continuations.remains(job)
    spec = JobSpec.model_validate(changed_spec(job.spec, changes))
    check(job, remains, spec)
    made = continuations.start(job, remains, spec).job
    with farm.monitor():
        return farm.finish(made)


def test_a_job_cannot_be_continued_with_other_aovs(farm: NoiseFarm) -> None:
    plain, rich = finished(farm), finished(farm, aovs=["depth"])
    with pytest.raises(
        CannotContinue, match=r"its samples have no AOVs, and more of them .* a new job"
    ):
        continued(farm, plain, aovs=["depth"], max_spp=120)
    with pytest.raises(CannotContinue, match=r"its samples have the AOVs depth, and more of them"):
        continued(farm, rich, aovs=["normal"], max_spp=120)


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
