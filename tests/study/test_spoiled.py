"""A study is made of whole slices, and shows whole pictures."""

import httpx

from plateau.study.ledger import study_level
from tests.service.api.routes.test_spoiled_files import api, farm, is_refused, spoil
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import ended_job

__all__ = ["api", "farm"]


def test_studies_are_made_of_whole_slices_and_show_whole_pictures(
    farm: NoiseFarm, api: httpx.Client
) -> None:
    job = ended_job(farm, slices=4, slice_spp=10)
    asked = {"job_id": job.id, "levels": [10, 20]}
    study = api.post("/v1/studies", json=asked).json()
    picture = f"{study['links']['self']}/levels/20.png"
    assert api.get(picture).status_code == 200
    spoil(farm, blob := study_level(study["id"], 20))
    is_refused(api.get(picture), blob)
    spoil(farm, farm.jobs.ledger(job.id)[1]["blob"])
    answer = api.post("/v1/studies", json={**asked, "name": "another"})
    assert answer.status_code == 409
    assert "slice 1 is lost or damaged" in answer.json()["detail"]
