"""Jobs over HTTP: submitted, listed, shown, cancelled, paused, put before others."""

import hashlib
import socket
import tempfile
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis

from plateau.farm.blobs import names as blob_names
from plateau.farm.blobs.store import Blobs
from tests.support.api_calls import BOX, FILM, problem, submit
from tests.support.farms.live_api import LARGEST_UPLOAD
from tests.support.farms.staged_job import StagedJob
from tests.support.faults.loop_disk import LoopDisk
from tests.support.scenes.bundles import mesh, scene, zipped


class TestSubmitting:
    def test_says_which_of_several_sensors_is_rendered(self, http: httpx.Client) -> None:
        film = f'<sensor type="perspective">{FILM.format(16)}</film></sensor>'
        said = "the scene has 3 sensors, and the first is rendered, sensor 0: `sensor` (--sensor) "
        said += "chooses another, up to 2"
        for spec, notes in [({}, [said]), ({"sensor": 1}, []), ({"parameters": [{}]}, [said])]:
            answer = submit(http, scene(sensor=film * 3), spec).json()
            job = (
                http.get(f"/v1/jobs/{answer['job_ids'][0]}").json() if "jobs" in answer else answer
            )
            assert job["notes"] == notes
        assert submit(http).json()["notes"] == []

    def test_refuses_a_rule_that_cannot_judge_so_small_an_image(self, http: httpx.Client) -> None:
        film = f'<sensor type="perspective">{FILM.format("$side")}</film></sensor>'
        said = "the rule jod judges images of 4×4 pixels or more, and this one has 3×9: make the "
        said += "film larger, or name another rule, such as visible"
        small = {"side": 3}
        for spec, field in [
            ({"parameters": small}, "spec"),
            ({"rule": "visible", "watch": ["jod"], "parameters": small}, "spec"),
            ({"rule": {"name": "jod"}, "parameters": [{"side": 4}, small]}, "spec.parameters.1"),
        ]:
            found = problem(submit(http, scene(sensor=film), spec), 422, "invalid-spec")
            assert found["errors"] == [{"field": field, "message": said}]
        visible = {"rule": "visible", "parameters": small}
        assert submit(http, scene(sensor=film), visible).status_code == 201
        far = {"parameters": {"side": 4}, "view": {"field_of_view_deg": 0.0001}}
        found = problem(submit(http, scene(sensor=film), far), 422, "invalid-spec")
        assert "4e+04 pixels in a degree" in found["errors"][0]["message"]
        large = {"parameters": {"side": 4}}
        assert submit(http, scene(sensor=film), large).status_code == 201

    def test_makes_a_job_and_stores_the_scene_once(
        self, http: httpx.Client, api_store: Blobs
    ) -> None:
        first = submit(http, spec={"max_spp": 200, "view": {"exposure_ev": 1.5}})
        assert first.status_code == 201
        job = first.json()
        # It says where the job is, and shows it
        assert first.headers["location"] == f"/v1/jobs/{job['id']}" == job["links"]["self"]
        assert http.get(first.headers["location"]).json() == job
        assert (job["state"], job["name"]) == ("queued", "box")
        # What was asked for is filled up with defaults
        assert job["spec"]["max_spp"] == 200
        assert job["spec"]["step"] == 100
        assert job["spec"]["view"]["exposure_ev"] == 1.5
        # The scene is stored under its hash, and listed
        sha256 = hashlib.sha256(BOX).hexdigest()
        assert job["scene_sha256"] == sha256
        assert api_store.get(blob_names.scene(sha256)) == BOX
        files = {
            "scene": ("C:\\scenes\\..\\b\u202eox.xml", BOX),
            "spec": ("s.json", b'{"seed": 7}'),
        }
        second = http.post("/v1/jobs", files=files).json()
        assert second["id"] != job["id"]
        assert (second["spec"]["seed"], second["name"]) == (7, "box")
        [stored] = http.get("/v1/scenes").json()["scenes"]
        assert stored["sha256"] == sha256
        assert (stored["bytes"], stored["width"], stored["height"]) == (len(BOX), 16, 9)

    def test_is_called_as_its_spec_says(self, http: httpx.Client) -> None:
        job = submit(http, spec={"name": "Kitchen, v1.2"}).json()
        assert (job["name"], job["spec"]["name"]) == ("Kitchen, v1.2", "Kitchen, v1.2")
        assert submit(http, spec={"name": "👩\u200d🚀.zip"}).status_code == 201
        for name in ("", "a\nb", "gpj\u202e.exr", "a\u200b", "x" * 101):
            told = problem(submit(http, spec={"name": name}), 422, "invalid-spec")
            assert [one["field"] for one in told["errors"]] == ["spec.name"]


class TestAnIdempotencyKey:
    KEY = {"Idempotency-Key": "monday-1"}  # noqa: RUF012

    def test_makes_one_job_of_a_repeated_request(self, http: httpx.Client) -> None:
        first = submit(http, headers=self.KEY)
        second = submit(http, headers=self.KEY)
        assert second.status_code == first.status_code == 201
        assert second.json() == first.json()
        assert "idempotency-replayed" not in first.headers
        assert second.headers["idempotency-replayed"] == "true"
        assert len(http.get("/v1/jobs").json()["jobs"]) == 1

        # Also where that names the stored scene
        first = first.json()
        by_hash = submit(http, None, scene_sha256=first["scene_sha256"], headers=self.KEY)
        assert by_hash.json()["id"] == first["id"]

    def test_is_refused_for_another_request_and_where_it_is_none(self, http: httpx.Client) -> None:
        first = submit(http, headers=self.KEY).json()
        for asked in ({"spec": {"seed": 1}}, {"content": BOX + b"\n"}):
            second = submit(http, headers=self.KEY, **asked)
            assert problem(second, 422, "idempotency-key-reused")["job_id"] == first["id"]
        for key in ("", "a b", "x" * 256):
            answer = submit(http, headers={"Idempotency-Key": key})
            assert "Idempotency-Key" in problem(answer, 422, "invalid-request")["detail"]


class TestABadSpec:
    @pytest.mark.parametrize(
        ("spec", "field"),
        [
            ({"view": {"fov": 1}}, "spec.view.fov"),
            ({"watch": [{"name": "fixed", "spp": 0}]}, "spec.watch.0.spp"),
            ({"seed": True}, "spec.seed"),
            ("[]", "spec"),
            ("[" * 100_000, "spec"),
            ('{"batch": "\\ud800"}', "spec"),
            ({"batch": ".."}, "spec.batch"),
            # Of many jobs
            ({"parameters": []}, "spec.parameters"),
            ({"parameters": [{}] * 1001}, "spec.parameters"),
            ({"parameters": [1]}, "spec.parameters.0"),
            ({"parameters": [{}], "rule": {"name": "fixed", "spp": 0}}, "spec.rule.spp"),
            ({"parameters": [{}], "frames": 3}, "spec.frames"),
            ({"parameters": [{}], "min_spp": 20_000}, "spec"),
            ({"parameters": [{}], "batch": "a\x00b"}, "spec.batch"),
        ],
    )
    def test_is_refused_by_the_field_that_is_wrong(
        self, http: httpx.Client, spec: dict[str, Any] | str, field: str
    ) -> None:
        found = problem(submit(http, spec=spec), 422, "invalid-spec")
        assert field in {one["field"] for one in found["errors"]}
        assert field in found["detail"]
        assert http.get("/v1/jobs").json()["jobs"] == []

    def test_is_refused_where_it_is_huge(self, http: httpx.Client) -> None:
        problem(submit(http, spec=" " * 1_100_000), 400, "malformed-request")


class TestABadUpload:
    @pytest.mark.parametrize(
        ("content", "code"),
        [
            (b"<scene", "xml-malformed"),
            (b"PK\x03\x04 and no more", "zip-malformed"),
            (zipped({"../scene.xml": BOX}).read(), "path-escape"),
        ],
    )
    def test_is_refused_with_the_check_s_words(
        self, http: httpx.Client, content: bytes, code: str
    ) -> None:
        found = problem(submit(http, content), 422, "broken-scene")
        assert found["code"] == code
        # and leaves nothing behind
        assert http.get("/v1/jobs").json()["jobs"] == []
        assert http.get("/v1/scenes").json()["scenes"] == []

    def test_is_refused_where_it_would_fill_the_disk(
        self, http: httpx.Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with LoopDisk(tmp_path, megabytes=8) as disk:
            monkeypatch.setattr(tempfile, "tempdir", str(disk.folder))
            problem(submit(http, BOX + b" " * 1_100_000), 422, "broken-scene")
            disk.fill()
            found = problem(submit(http, BOX + b" " * 1_100_000), 503, "store-unavailable")
            assert "keeps uploads is nearly full" in found["detail"]
            monkeypatch.undo()

    def test_says_which_line_is_at_fault(self, http: httpx.Client) -> None:
        bundle = zipped({"scene.xml": scene("", mesh("gone.ply"))}).read()
        found = problem(submit(http, bundle), 422, "broken-scene")
        assert (found["file"], found["line"]) == ("scene.xml", 3)

    @pytest.mark.parametrize("announced", [True, False])
    def test_is_refused_where_it_is_too_large(self, http: httpx.Client, announced: bool) -> None:
        files = {"scene": ("box.xml", b" " * (LARGEST_UPLOAD + 3_000_000))}
        request = http.build_request("POST", "/v1/jobs", files=files)
        if not announced:  # chunked: it shows only while it streams
            body = request.read()
            content = (body[i : i + 65536] for i in range(0, len(body), 65536))
            headers = {"Content-Type": request.headers["content-type"]}
            request = http.build_request("POST", "/v1/jobs", content=content, headers=headers)
            assert "content-length" not in request.headers
        problem(http.send(request), 413, "upload-too-large")
        # The next one is taken, and so large a scene alone is not
        answer = submit(http, BOX + b" " * LARGEST_UPLOAD)
        assert problem(answer, 413, "upload-too-large")["code"] == "too-large"
        assert submit(http).status_code == 201

    def test_that_is_endless_is_refused_all_the_same(self, http: httpx.Client) -> None:
        # It is read for a while, so that the answer arrives, and not for ever.
        url = http.base_url
        with socket.create_connection((url.host, url.port or 80), timeout=30) as client:
            client.sendall(
                b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n"
                b"Content-Type: multipart/form-data; boundary=x\r\n"
                b"Content-Length: 1000000000000\r\n\r\n"
            )
            assert client.recv(65536).startswith(b"HTTP/1.1 413 ")

    def test_is_refused_by_the_part_that_is_wrong(self, http: httpx.Client) -> None:
        for files, field in (
            ({"scene": (None, "box.xml")}, "scene"),
            ({"scene_sha256": (None, "ABC")}, "scene_sha256"),
            ({"scene": ("a.xml", BOX), "scene_sha256": (None, "0" * 64)}, "scene_sha256"),
            ({"scene": ("a.xml", BOX), "sepc": (None, "{}")}, "sepc"),
        ):
            found = problem(http.post("/v1/jobs", files=files), 422, "invalid-request")
            assert [one["field"] for one in found["errors"]] == [field]
        for answer in (http.post("/v1/jobs"), submit(http, None, {})):
            problem(answer, 422, "no-scene")
        problem(submit(http, None, scene_sha256="0" * 64), 422, "unknown-scene")
        for body in ({"step": 1}, "x" * 100_000):
            problem(http.post("/v1/jobs", json=body), 415, "not-multipart")


def test_deletion_refuses_what_has_not_ended(http: httpx.Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    for method, call in (("DELETE", ""), ("POST", "/restore")):
        found = problem(http.request(method, f"/v1/jobs/{job.id}{call}"), 409, "job-not-ended")
        assert found["state"] == "queued"
        problem(http.request(method, f"/v1/jobs/{'0' * 12}{call}"), 404, "unknown-job")
        problem(http.request(method, f"/v1/batches/none{call}"), 404, "unknown-batch")


@pytest.mark.parametrize("announced", [True, False])
def test_changing_the_priority_reads_no_more_of_a_body_than_it_needs(
    http: httpx.Client, announced: bool
) -> None:
    job = submit(http).json()["id"]
    body = b'{"priority": 1' + b" " * 2**16 + b"}"
    content = body if announced else (body[i : i + 9999] for i in range(0, len(body), 9999))
    headers = {"Content-Type": "application/json"}
    answer = http.patch(f"/v1/jobs/{job}", content=content, headers=headers)
    assert problem(answer, 413, "upload-too-large")["limit_bytes"] == 2**16
    # Nor does what takes no form of one
    answer = http.post(f"/v1/jobs/{job}/again", files={"scene": body})
    assert problem(answer, 413, "upload-too-large")["limit_bytes"] == 2**16


def test_an_unknown_job_is_a_404_everywhere(http: httpx.Client, client: redis.Redis) -> None:
    # The last is the name of one of a job's keys in Redis
    for job_id in ("0123456789ab", "nope", f"{StagedJob(client).id}:events"):
        path = f"/v1/jobs/{job_id}"
        answers = [
            http.patch(path, json={"priority": 1}),
            http.post(f"{path}/again", json={}),
            *(http.post(f"{path}/{call}") for call in ("cancel", "pause", "resume")),
            *(
                http.get(path + rest)
                for rest in (
                    *("", "/curve", "/curve.csv", "/events", "/log", "/slices", "/log?slice=0"),
                    *("/image.png", "/image.exr", "/difference.png", "/results.zip"),
                )
            ),
        ]
        for answer in answers:
            assert job_id in problem(answer, 404, "unknown-job")["detail"]
