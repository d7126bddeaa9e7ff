"""A study shows whole pictures."""

import httpx

from plateau.study.ledger import study_level
from tests.service.api.routes.test_spoiled_files import api, farm, is_refused, spoil
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import ended_job

__all__ = ["api", "farm"]


def test_a_spoiled_picture_is_not_shown(farm: NoiseFarm, api: httpx.Client) -> None:
    job = ended_job(farm, slices=4, slice_spp=10)
    asked = {"job_id": job.id, "levels": [10, 20]}
    study = api.post("/v1/studies", json=asked).json()
    picture = f"{study['links']['self']}/levels/20.png"
    assert api.get(picture).status_code == 200
    spoil(farm, blob := study_level(study["id"], 20))
    is_refused(api.get(picture), blob)
