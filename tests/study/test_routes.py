"""Observer studies over HTTP: made from kept slices, answered durably, exported."""

import csv
import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.png import encode_png
from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.model.job import Job
from plateau.farm.redis import keys
from plateau.farm.sweep import sweep
from plateau.metric import encode_srgb
from plateau.study import keys as study_keys
from plateau.study.answers_table import fit_table
from plateau.study.ledger import Studies, of_study, study_level
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.farms.studies import SCREEN, ended_job

SPP = 10
LEVELS = [10, 20, 40]


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, api_store: Blobs) -> NoiseFarm:
    folder = Path(api_store.where).parent
    farm = NoiseFarm(client, redis_url, folder)
    farm.store = api_store
    # The store has blobs of other tests, and Redis has forgotten whose it is
    mark = api_store.mark() or api_store.make_mark("the tests'")
    client.hset(keys.STORE, mapping={"id": mark, "paired": 1})
    check_pair(client, api_store)
    return farm


@pytest.fixture
def job(farm: NoiseFarm) -> Job:
    return ended_job(farm, slices=8, slice_spp=SPP)


def made(http: httpx.Client, job: Job, **asked: Any) -> dict[str, Any]:
    answer = http.post("/v1/studies", json={"job_id": job.id, "levels": LEVELS, **asked})
    assert answer.status_code == 201, answer.text
    study: dict[str, Any] = answer.json()
    assert answer.headers["location"] == study["links"]["self"]
    return study


def take_part(http: httpx.Client, study: dict[str, Any], name: str = "o-1") -> dict[str, Any]:
    path = f"{study['links']['self']}/observers/{name}"
    answer = http.put(path, json={"screen": SCREEN})
    assert answer.status_code == 200, answer.text
    return answer.json()


def answer(
    http: httpx.Client, study: dict[str, Any], trial: int, *, seen: bool, name: str = "o-1"
) -> httpx.Response:
    path = f"{study['links']['self']}/observers/{name}/answers/{trial}"
    return http.put(path, json={"seen": seen, "seconds": 1.5})


def merged_png(slices: int, seed_from: int = 0, spp: int = SPP) -> bytes:
    films = sum(
        noise_film(seed_from + index, spp, 1.0).astype(np.float64) for index in range(slices)
    )
    return encode_png(encode_srgb((films[..., :3] / films[..., 3:]).astype(np.float32), 0.0))


class TestPictures:
    def test_are_those_of_the_merged_slices(
        self, http: httpx.Client, farm: NoiseFarm, job: Job
    ) -> None:
        study = made(http, job)
        assert (study["levels"], study["reference_spp"]) == (LEVELS, 80)
        assert not study["independent"]
        root = study["links"]["self"]
        for spp in LEVELS:
            assert http.get(f"{root}/levels/{spp}.png").content == merged_png(spp // SPP)
        assert http.get(study["links"]["reference"]).content == merged_png(8)
        assert http.get(f"{root}/levels/30.png").status_code == 404

    def test_have_another_job_s_reference_where_one_is_named(
        self, http: httpx.Client, farm: NoiseFarm, job: Job
    ) -> None:
        other = ended_job(farm, slices=5, slice_spp=20, seed=7, film_from=100)
        study = made(http, job, reference_job_id=other.id)
        assert (study["independent"], study["reference_spp"]) == (True, 100)
        assert http.get(study["links"]["reference"]).content == merged_png(5, 100, 20)
        # One with the same noise is not independent, whatever its seed
        alike = ended_job(farm, slices=8, slice_spp=SPP, seed=9)
        assert not made(http, job, reference_job_id=alike.id)["independent"]

    def test_stay_when_the_job_is_forgotten(
        self, http: httpx.Client, client: redis.Redis, farm: NoiseFarm, job: Job
    ) -> None:
        study = made(http, job)
        swept = sweep(client, farm.store, results_older_than_s=0)
        assert swept.jobs == 1
        assert http.get(f"/v1/jobs/{job.id}").status_code == 404
        assert http.get(study["links"]["reference"]).content == merged_png(8)
        take_part(http, study)
        assert answer(http, study, 0, seen=True).status_code == 200

    def test_of_what_was_never_finished_are_swept(
        self, client: redis.Redis, farm: NoiseFarm, job: Job, http: httpx.Client
    ) -> None:
        study = made(http, job)
        studies = Studies(client)
        begun = studies.begin()
        for study_id in (begun, "0123456789ab"):
            farm.store.put(study_level(study_id, 10), b"half a study")
        sweep(client, farm.store)
        assert not farm.store.names(of_study("0123456789ab"))
        assert len(farm.store.names(of_study(begun))) == 1
        assert len(farm.store.names(of_study(study["id"]))) == 4
        # And it can no longer be shown once its time is over
        client.delete(study_keys.study(begun, "making"))
        sweep(client, farm.store)
        assert not farm.store.names(of_study(begun))

    def test_are_made_once_for_a_request_however_often_it_is_sent(
        self, http: httpx.Client, farm: NoiseFarm, job: Job
    ) -> None:
        before = len(farm.store.names("studies/"))
        with ThreadPoolExecutor(4) as pool:
            ids = {study["id"] for study in pool.map(lambda _: made(http, job), range(4))}
        assert len(ids) == 1
        assert len(farm.store.names("studies/")) == before + 4
        assert made(http, job, name="in the dark")["id"] not in ids


def test_levels_are_the_paper_s_where_none_are_named(http: httpx.Client, farm: NoiseFarm) -> None:
    job = ended_job(farm, slices=30, slice_spp=1)
    reference = ended_job(farm, slices=50, slice_spp=2, seed=1)
    study = made(http, job, reference_job_id=reference.id, levels=None)
    assert study["levels"] == [1, 5, 9, 13, 17, 21, 25]
    assert study["trials"] == 14
    first = made(http, job, reference_job_id=reference.id, levels=None, method="limits")
    assert first["levels"][0] == 1
    assert first["levels"][-1] <= 30


class TestAnswers:
    def test_are_in_the_order_of_the_study(self, http: httpx.Client, job: Job) -> None:
        study = made(http, job)
        observer = take_part(http, study)
        assert [trial["trial"] for trial in observer["trials"]] == list(range(6))
        reference = study["links"]["reference"]
        for trial in observer["trials"]:
            assert trial[trial["reference"]] == reference
        # Loaded again, by whatever screen, the order and the first screen stay
        again = http.put(
            f"{study['links']['self']}/observers/o-1",
            json={"screen": {**SCREEN, "viewing_distance_cm": 99.0}},
        )
        assert again.json() == observer
        assert http.get(f"{study['links']['self']}/observers/o-1").json() == observer
        assert take_part(http, study, "o-2")["number"] == 1

    def test_count_once(self, http: httpx.Client, job: Job) -> None:
        study = made(http, job)
        take_part(http, study)
        first = answer(http, study, 0, seen=True).json()
        late = answer(http, study, 0, seen=False)
        assert (late.status_code, late.json()) == (200, first)
        shown = http.get(study["links"]["self"]).json()["result"]
        assert (shown["answers"], shown["observers"], shown["finished"]) == (1, 1, 0)
        assert http.get(f"{study['links']['self']}/observers/o-1").json()["answered"] == [0]

    def test_are_exported_line_by_line(self, http: httpx.Client, job: Job) -> None:
        study = made(http, job, name="BOX 1")
        for name in ("o-1", "o-2"):
            observer = take_part(http, study, name)
            for trial in observer["trials"]:
                spp = int(trial["left" if trial["reference"] == "right" else "right"][-6:-4])
                answer(http, study, trial["trial"], seen=spp < 20 or name == "o-1", name=name)
        rows = list(csv.DictReader(io.StringIO(http.get(study["links"]["trials_csv"]).text)))
        assert len(rows) == 12
        assert {row["observer"] for row in rows} == {"o-1", "o-2"}
        assert rows[0]["scene"] == "BOX 1"
        assert rows[0]["pixels_per_degree"] == "41.89"
        result = http.get(study["links"]["self"]).json()["result"]
        assert result["finished"] == 2
        assert result["levels"][1] == {"spp": 20, "shown": 4, "seen": 2}

    def test_are_fitted_as_the_study_shows_them(
        self, http: httpx.Client, job: Job, tmp_path: Path
    ) -> None:
        study = made(http, job, name="=1+1")
        for name in ("o-1", "o-2", "o-3", "o-4"):
            for trial in take_part(http, study, name)["trials"]:
                seen = "/10.png" in trial["left"] + trial["right"]
                answer(http, study, trial["trial"], seen=seen, name=name)
        (tmp_path / "trials").write_text(http.get(study["links"]["trials_csv"]).text)
        [fitted] = fit_table(tmp_path / "trials")
        assert fitted.scene == "'=1+1"  # no formula for a spreadsheet
        threshold = fitted.threshold(0.5)
        assert threshold is not None
        assert 10 < threshold < 20
        shown = http.get(study["links"]["self"])
        assert shown.status_code == 200, shown.text
        result = shown.json()["result"]
        assert result["thresholds"][0]["spp"] == pytest.approx(threshold)
        assert result["suggested_levels"] == [10, 20]


class TestRefused:
    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"levels": [10]}, "2 to 24 different levels"),
            ({"levels": [10, 10]}, "2 to 24 different levels"),
            ({"levels": [10, 15]}, "no image of 15 spp"),
            ({"levels": [10, 90]}, "no image of 90 spp"),
        ],
    )
    def test_levels_that_there_are_not(
        self, http: httpx.Client, job: Job, change: dict[str, Any], words: str
    ) -> None:
        refused = http.post("/v1/studies", json={"job_id": job.id, **change})
        assert refused.json()["type"] == "/problems/cannot-study"
        assert words in refused.json()["detail"]

    def test_jobs_without_slices(self, http: httpx.Client, farm: NoiseFarm) -> None:
        without = ended_job(farm, slices=2, slice_spp=SPP, keep_slices=False)
        for job, words in (
            (without, "did not keep its slices"),
            (farm.submit(keep_slices=True), "is queued"),
        ):
            refused = http.post("/v1/studies", json={"job_id": job.id})
            assert refused.status_code == 409
            assert words in refused.json()["detail"]
        assert http.post("/v1/studies", json={"job_id": "0" * 12}).status_code == 404

    def test_a_slice_that_is_gone_leaves_nothing(
        self, http: httpx.Client, farm: NoiseFarm, job: Job
    ) -> None:
        before = farm.store.names("studies/")
        farm.store.delete(farm.jobs.ledger(job.id)[5]["blob"])
        refused = http.post("/v1/studies", json={"job_id": job.id, "levels": LEVELS})
        assert (refused.status_code, "slice 5" in refused.text) == (409, True)
        assert farm.store.names("studies/") == before

    def test_what_is_no_answer(self, http: httpx.Client, job: Job) -> None:
        study = made(http, job)
        assert answer(http, study, 0, seen=True).json()["type"] == "/problems/unknown-observer"
        take_part(http, study)
        assert answer(http, study, 6, seen=True).json()["type"] == "/problems/unknown-trial"
        root = f"{study['links']['self']}/observers"
        for body in ({}, {"seen": "yes", "seconds": 1}, {"seen": True, "seconds": -1}):
            assert http.put(f"{root}/o-1/answers/0", json=body).status_code == 422
        for name in ("-x", "a b", "Jane%20Doe", "x" * 33, "=1"):
            assert http.put(f"{root}/{name}", json={"screen": SCREEN}).status_code == 422
        far = {"screen": {**SCREEN, "viewing_distance_cm": 1e9}}
        assert http.put(f"{root}/o-2", json=far).status_code == 422


def test_only_who_made_a_study_removes_it(
    http: httpx.Client, client: redis.Redis, farm: NoiseFarm, job: Job
) -> None:
    keyring = ApiKeys(client)
    mine, others, looks = (
        {"Authorization": f"Bearer {keyring.create(name, role, KeyLimits())[1]}"}
        for name, role in (
            ("mine", Role.SUBMITTER),
            ("others", Role.SUBMITTER),
            ("looks", Role.VIEWER),
        )
    )
    asked = {"job_id": job.id, "levels": LEVELS}
    study = http.post("/v1/studies", json=asked, headers=mine).json()
    path = study["links"]["self"]
    assert http.get(path).status_code == 401
    # To answer is to change something: it takes a submitter's key, but not the one who made it
    screen = {"screen": SCREEN}
    assert http.put(f"{path}/observers/o-1", json=screen, headers=looks).status_code == 403
    assert http.put(f"{path}/observers/o-1", json=screen, headers=others).status_code == 200
    refused = http.delete(path, headers=others)
    assert refused.json()["type"] == "/problems/not-your-study"
    assert http.delete(path, headers=mine).status_code == 204
    assert http.get(path, headers=looks).status_code == 404
    assert not farm.store.names(of_study(study["id"]))
    assert not client.exists(
        *(study_keys.study(study["id"], part) for part in ("", "observers", "answers", "making"))
    )
    # The same request may be made again, and is a new study
    assert http.post("/v1/studies", json=asked, headers=mine).json()["id"] != study["id"]
