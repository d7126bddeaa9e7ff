"""Batches over HTTP: many jobs by one request, summed up, steered."""

from typing import Any
from urllib.parse import quote

import httpx
import pytest
import redis

from plateau.farm.wire.batch_views import batch_path
from tests.support.api_calls import problem, submit
from tests.support.farms.staged_job import StagedJob
from tests.support.scenes.bundles import scene

#: A scene whose film is as wide as a parameter says.
WIDE = scene(
    sensor='<sensor type="perspective"><film type="hdrfilm">'
    '<integer name="width" value="$w"/><integer name="height" value="9"/></film></sensor>'
)
NAMES = ["a/../b", "50 %2F", "夜景", "a?b#c"]


def frames(*widths: object, **spec: Any) -> dict[str, Any]:
    return {"parameters": [{"w": width} for width in widths], **spec}


def listed(http: httpx.Client, **asked: str) -> list[dict[str, Any]]:
    return http.get("/v1/jobs", params=asked).json()["jobs"]


class TestAListOfParameters:
    def test_gets_a_name_where_it_has_none(self, http: httpx.Client) -> None:
        first, second = (
            submit(http, WIDE, frames(16), filename="walk.v2.xml").json()["name"] for _ in "ab"
        )
        assert first.startswith("walk.v2-")
        assert first != second
        assert listed(http, batch=first)[0]["spec"]["batch"] == first

    @pytest.mark.parametrize(
        ("widths", "slug", "field"),
        [
            ((16, 0, 17), "broken-scene", "spec.parameters.1"),
            ((16, 17, []), "invalid-spec", "spec.parameters.2.w"),
            ((16, 10_000_000), "broken-scene", "spec.parameters.1"),
        ],
    )
    def test_is_refused_as_a_whole_by_the_entry_that_is_wrong(
        self, http: httpx.Client, widths: tuple[Any, ...], slug: str, field: str
    ) -> None:
        found = problem(submit(http, WIDE, frames(*widths)), 422, slug)
        assert field in found["detail"]
        assert found["errors"][0]["field"] == field
        assert listed(http) == []
        assert http.get("/v1/scenes").json()["scenes"] == []
        assert http.get("/v1/batches").json()["batches"] == []

    def test_with_a_thousand_mistakes_names_some_of_them(self, http: httpx.Client) -> None:
        found = problem(submit(http, WIDE, frames(*[None] * 1000)), 422, "invalid-spec")
        assert 10 <= len(found["errors"]) <= 50


class TestABatchByItsName:
    @pytest.mark.parametrize("name", NAMES)
    def test_is_found_whatever_is_in_it(self, http: httpx.Client, name: str) -> None:
        made = submit(http, WIDE, frames(16, batch=name)).json()
        submit(http, WIDE, frames(16, batch="other"))
        assert made["name"] == name
        links = made["links"]
        assert links["self"] == batch_path(name) == f"/v1/batches/{quote(name, safe='')}"
        assert http.get(links["self"]).json()["name"] == name
        assert http.head(links["self"]).status_code == 200
        assert [job["id"] for job in http.get(links["jobs"]).json()["jobs"]] == made["job_ids"]
        for steer, state in (("pause", "queued"), ("resume", "queued"), ("cancel", "cancelled")):
            answer = http.post(links[steer])
            assert (answer.status_code, answer.json()["name"]) == (202, name)
            assert [one["state"] for one in answer.json()["jobs"]] == [state]
        names = [one["name"] for one in http.get("/v1/batches").json()["batches"]]
        assert names == ["other", name]

    def test_is_said_not_to_be_there_and_is_one_segment_of_the_path(
        self, http: httpx.Client
    ) -> None:
        for what in ("", "/cancel", "/pause", "/resume"):
            answer = http.request("POST" if what else "GET", f"/v1/batches/no%2Fne{what}")
            assert answer.status_code == 404
            assert answer.json()["type"] == "/problems/unknown-batch"
            assert "'no/ne'" in answer.json()["detail"]
        submit(http, WIDE, frames(16, batch="a/b"))
        assert http.get("/v1/batches/a/b").json()["type"] == "/problems/unknown-path"
        refused = http.put("/v1/batches/a%2Fb")
        assert (refused.status_code, refused.headers["allow"]) == (405, "DELETE, GET, HEAD")


def test_a_summary_tells_how_far_it_is(http: httpx.Client, client: redis.Redis) -> None:
    batch = submit(http, WIDE, frames(32, 32, 32, batch="b", max_spp=1000)).json()
    done, rendering, queued = batch["job_ids"]
    staged = StagedJob(client, done)
    staged.commit(8)
    staged.point(200, 3)
    staged.end()
    staged.finish(200)
    staged = StagedJob(client, rendering)
    staged.commit(4)
    staged.point(100, 3)
    found = http.get(batch["links"]["self"]).json()
    assert found["states"] == {"converged": 1, "rendering": 1, "queued": 1}
    assert (found["finished"], found["ended_at"]) == (1, None)
    assert found["spp"] == {"least": 0, "most": 200, "mean": 100}
    assert found["estimate_fraction"]["least"] == pytest.approx(0.1 / 200)
    assert found["machine_s"] == pytest.approx(6)
    assert found["samples_saved"] == 800 * 32 * 24
    # It has begun with its first job, and ends with its last
    first = http.get(f"/v1/jobs/{done}").json()
    assert (found["created_at"], found["started_at"]) == (first["created_at"], first["started_at"])
    for job_id in (rendering, queued):
        last = http.post(f"/v1/jobs/{job_id}/cancel").json()
    assert http.get(batch["links"]["self"]).json()["ended_at"] == last["ended_at"]


class TestAShot:
    @pytest.mark.parametrize(
        ("spec", "field", "words"),
        [
            (frames(16, 17, shot={"fps": 24}), "spec.parameters.1", "17×9, and spec.parameters.0"),
            (frames(16, shot={"fps": 24}), "spec", "has 2 frames or more"),
            (frames(3, 3, shot={"fps": 24}), "spec.parameters.0", "at least 4×4 pixels"),
            (frames(16, 16, shot={"fps": 481}), "spec.shot.fps", "at most 480"),
            (
                frames(16, 16, shot={"fps": 24}, allocation={"name": "zones"}),
                "spec",
                "choose the allocation frame",
            ),
            (
                {"parameters": {"w": 16}, "shot": {"fps": 24}},
                "spec.shot",
                "give `parameters` as a list",
            ),
        ],
    )
    def test_that_cannot_be_judged_is_refused(
        self, http: httpx.Client, spec: dict[str, Any], field: str, words: str
    ) -> None:
        refused = problem(submit(http, WIDE, spec), 422, "invalid-spec")
        assert [one["field"] for one in refused["errors"]] == [field]
        assert words in refused["detail"], refused["detail"]
        assert http.get("/v1/jobs").json()["jobs"] == []

    def test_is_shown_frame_by_frame(self, http: httpx.Client) -> None:
        shot = {"fps": 23.976, "target": 9}
        made = submit(http, WIDE, frames(16, 16, batch="walk", shot=shot)).json()
        assert made["shot"]["state"] == "rendering"
        # One that joins later is no frame of it
        assert submit(http, WIDE, frames(17, batch="walk")).status_code == 201
        found = http.get(http.get(batch_path("walk")).json()["links"]["shot"]).json()
        assert (found["fps"], found["target"], found["frames"], found["looks"]) == (23.976, 9, 2, 0)
        assert [one["job"] for one in found["by_frame"]] == made["job_ids"]
        job = http.get(f"/v1/jobs/{made['job_ids'][1]}").json()
        assert job["in_shot"] == {"id": made["job_ids"][0], "waits": None, "answer": None}
        for picture in ("film", "flicker"):
            problem(http.get(found["links"][picture]), 404, "no-image-yet")
        # Nor is one that renders a frame again
        http.post(f"/v1/jobs/{job['id']}/cancel")
        again = http.post(f"/v1/jobs/{job['id']}/again", json={}).json()
        assert (again["spec"]["batch"], again["in_shot"]) == ("walk", None)
        assert http.get(found["links"]["self"]).json()["id"] == found["id"]
        submit(http, WIDE, frames(16, 16, batch="still"))
        for path in ("shot", "shot/film.png", "shot/flicker.png"):
            problem(http.get(f"/v1/batches/still/{path}"), 404, "no-shot")
            problem(http.get(f"/v1/batches/none/{path}"), 404, "unknown-batch")
