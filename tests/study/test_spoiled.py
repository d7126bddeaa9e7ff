"""A study is made of whole slices, and shows whole pictures."""

from pathlib import Path

import redis

from plateau.study.ledger import study_level
from tests.service.api.routes.test_jobs import problem
from tests.service.api.routes.test_spoiled_files import spoil
from tests.support.farms.live_api import live_http
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import ended_job


def test_studies_are_made_of_whole_slices_and_show_whole_pictures(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    job = ended_job(farm, slices=4, slice_spp=10)
    asked = {"job_id": job.id, "levels": [10, 20]}
    with live_http(redis_url, farm.store) as http:
        study = http.post("/v1/studies", json=asked).json()
        picture = f"{study['links']['self']}/levels/20.png"
        assert http.get(picture).status_code == 200
        spoil(farm.store, blob := study_level(study["id"], 20))
        assert blob in problem(http.get(picture), 500, "spoiled-file")["detail"]
        spoil(farm.store, farm.jobs.ledger(job.id)[1]["blob"])
        answer = http.post("/v1/studies", json={**asked, "name": "another"})
        assert answer.status_code == 409
        assert "slice 1 is lost or damaged" in answer.json()["detail"]
