"""A study shows whole pictures."""

from pathlib import Path

import redis

from plateau.study.ledger import study_level
from tests.service.api.routes.test_spoiled_files import spoil
from tests.support.api_calls import problem
from tests.support.farms.live_api import live_http
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import ended_job


def test_a_spoiled_picture_is_not_shown(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    job = ended_job(farm, slices=4, slice_spp=10)
    with live_http(redis_url, farm.store) as http:
        study = http.post("/v1/studies", json={"job_id": job.id, "levels": [10, 20]}).json()
        picture = f"{study['links']['self']}/levels/20.png"
        assert http.get(picture).status_code == 200
        spoil(farm.store, blob := study_level(study["id"], 20))
        assert blob in problem(http.get(picture), 500, "spoiled-file")["detail"]
