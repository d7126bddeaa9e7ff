"""Checking a scene without a job."""

import httpx

from plateau.farm.wire.examples import SCENE_SHA256, SCENE_XML
from tests.support.api_calls import problem, submit


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


def test_the_renderer_of_a_scene_decides_the_variant_of_its_job(http: httpx.Client) -> None:
    analytic = '{"analytic": 1, "width": 16, "height": 16}'
    found = check(http, scene=analytic, spec='{"parameters": {"width": 32}}').json()
    assert (found["kind"], found["entry"], found["width"]) == ("json", "scene.json", 32)
    assert submit(http, analytic, "{}").json()["spec"]["variant"] == "analytic:numpy"
    assert submit(http, analytic, '{"variant": "analytic:numpy"}').status_code == 201
    assert submit(http, SCENE_XML, "{}").json()["spec"]["variant"] == "auto"
    full_name = submit(http, SCENE_XML, '{"variant": "mitsuba:llvm_ad_rgb"}')
    assert full_name.json()["spec"]["variant"] == "llvm_ad_rgb"
    many = submit(http, analytic, '{"batch": "b", "parameters": [{"width": 8}, {"width": 16}]}')
    assert many.status_code == 201
    jobs = http.get("/v1/jobs", params={"batch": "b"}).json()["jobs"]
    assert [job["spec"]["variant"] for job in jobs] == ["analytic:numpy"] * 2
    for scene, variant in ((analytic, "llvm_ad_rgb"), (SCENE_XML, "analytic:numpy")):
        for refused in (
            submit(http, scene, f'{{"variant": "{variant}"}}'),
            check(http, scene=scene, spec=f'{{"variant": "{variant}"}}'),
        ):
            body = problem(refused, 422, "invalid-spec")
            assert body["errors"][0]["field"] == "spec.variant"
            assert f"has no variant {variant}" in body["detail"]
