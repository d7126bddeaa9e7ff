"""Checking a scene without a job."""

import httpx

from plateau.farm.wire.examples import SCENE_SHA256, SCENE_XML
from tests.service.api.test_jobs import problem


def check(http: httpx.Client, scene: str = SCENE_XML, spec: str = "{}") -> httpx.Response:
    return http.post("/v1/scenes", files={"scene": ("sphere.xml", scene)}, data={"spec": spec})


def test_a_scene_is_checked_and_stored(http: httpx.Client) -> None:
    answer = check(http)
    assert answer.status_code == 200
    found = answer.json()
    assert (found["sha256"], found["name"]) == (SCENE_SHA256, "sphere.xml")
    assert (found["width"], found["height"], found["sensors"]) == (256, 256, 1)
    assert found["parameters"] == {"width": "256", "height": "256"}
    assert (found["kind"], found["files"], found["bytes"]) == ("xml", 1, len(SCENE_XML))
    # It makes no job, and can be submitted by its hash
    assert http.get("/v1/jobs").json()["jobs"] == []
    data = {"scene_sha256": SCENE_SHA256}
    assert http.post("/v1/jobs", files={"spec": (None, "{}")}, data=data).status_code == 201


def test_parameters_count(http: httpx.Client) -> None:
    assert check(http, spec='{"parameters": {"width": 64}}').json()["width"] == 64
    problem(check(http, spec='{"parameters": {"depth": 64}}'), 422, "broken-scene")
    # A stored one is looked at again with others
    answer = http.post(
        "/v1/scenes",
        files={"spec": (None, '{"parameters": {"width": 32}}')},
        data={"scene_sha256": SCENE_SHA256},
    )
    assert (answer.json()["width"], answer.json()["name"]) == (32, "sphere.xml")


def test_what_is_refused_is_refused_as_with_a_job(http: httpx.Client) -> None:
    problem(check(http, scene="<scene"), 422, "broken-scene")
    problem(http.post("/v1/scenes", files={"spec": (None, "{}")}), 422, "no-scene")
    problem(http.post("/v1/scenes", json={}), 415, "not-multipart")
