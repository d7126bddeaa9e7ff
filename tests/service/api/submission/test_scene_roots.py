"""Scenes where they lie, over HTTP: named, checked, listed, and refused."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from plateau import Client
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle.placed import LIST_NAME
from plateau.farm.model.scene_roots import read_roots
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.service.api.scene_checks.placing import Placing
from tests.support.api_calls import FILM, problem
from tests.support.farms.live_api import live_api
from tests.support.scenes.bundles import PLY, mesh, scene, zipped

SENSOR = f'<sensor type="perspective">{FILM.format("$width")}</film></sensor>'
WIDTH = '<default name="width" value="16"/><default name="mesh" value="hall"/>'


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("studio") / "assets"


@pytest.fixture
def assets(root: Path) -> Path:
    if root.exists():
        shutil.rmtree(root)
    walk = root / "walk"
    walk.mkdir(parents=True)
    (walk / "scene.xml").write_bytes(scene(WIDTH, mesh("$mesh.ply"), SENSOR, sensor=""))
    (walk / "hall.ply").write_bytes(PLY)
    (walk / "door.ply").write_bytes(PLY + b"#")
    return root


@pytest.fixture(scope="module")
def url(embedded_redis: EmbeddedRedis, api_store: Blobs, root: Path) -> Iterator[str]:
    """An API with a scene root, for all tests: its checks of scenes take long to begin."""
    placing = Placing(read_roots(f"assets={root}|Z:/assets"), root.parent / "hashes")
    with live_api(embedded_redis.url, api_store, placing=placing) as url:
        yield url


@pytest.fixture
def studio(url: str, redis_url: str, assets: Path) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=url, verify=False, trust_env=False, timeout=60) as http:
        yield http


def submit(http: httpx.Client, path: str, spec: str = "{}", **more: str) -> httpx.Response:
    parts = {"scene_path": path, "spec": spec, **more}
    return http.post("/v1/jobs", files={name: (None, text) for name, text in parts.items()})


def test_a_scene_is_named_and_not_sent(
    studio: httpx.Client, url: str, api_store: Blobs, assets: Path
) -> None:
    made = submit(studio, "{assets}/walk/scene.xml", '{"requires": ["gpu"]}')
    assert made.status_code == 201, made.text
    job = made.json()
    assert (job["name"], job["spec"]["requires"]) == ("walk", ["gpu", "root.assets"])
    # Only workers with the root get it
    assert "tags gpu, root.assets" in studio.get(f"/v1/jobs/{job['id']}").json()["waits_for"]
    # What is stored is small, and its hash is that of the scene
    stored = api_store.get(blobs.scene(job["scene_sha256"]))
    assert hashlib.sha256(stored).hexdigest() == job["scene_sha256"]
    assert LIST_NAME.encode() in stored
    # Other names of it are the same scene; so is the stored one, with its root
    for path in (f"{assets}/walk", "Z:\\assets\\walk\\scene.xml"):
        assert submit(studio, path).json()["scene_sha256"] == job["scene_sha256"]
    parts = {"scene_sha256": (None, job["scene_sha256"])}
    again = studio.post("/v1/jobs", files=parts).json()
    assert again["spec"]["requires"] == ["root.assets"]
    # The client names it in the same way, and the list tells which roots there are
    with Client(url, timeout_s=0.15) as client:  # it waits for longer while files are read
        assert client.submit("{assets}/walk/scene.xml").scene_sha256 == job["scene_sha256"]
    assert studio.get("/v1/scenes").json()["roots"] == ["assets"]
    # Another content is another scene
    (assets / "walk" / "hall.ply").write_bytes(PLY + b"##")
    assert submit(studio, "{assets}/walk").json()["scene_sha256"] != job["scene_sha256"]


def test_a_batch_has_the_files_of_all_its_frames(studio: httpx.Client) -> None:
    spec = '{"batch": "doors", "parameters": [{"mesh": "hall"}, {"mesh": "door", "width": 32}]}'
    assert submit(studio, "{assets}/walk", spec).status_code == 201
    jobs = studio.get("/v1/jobs", params={"batch": "doors"}).json()["jobs"]
    assert [job["spec"]["requires"] for job in jobs] == [["root.assets"]] * 2
    found = studio.post(
        "/v1/scenes", files={"scene_path": (None, "{assets}/walk"), "spec": (None, "{}")}
    ).json()
    assert (found["files"], found["kind"], found["width"]) == (3, "zip", 16)


def test_what_is_refused_and_why(studio: httpx.Client, http: httpx.Client, assets: Path) -> None:
    (assets / "out").symlink_to("/etc")
    for path, code in (
        ("{assets}/../secret.xml", "path-escape"),
        ("/etc/passwd", "path-escape"),
        ("{assets}/out/passwd", "path-escape"),
        ("{assets}/none.xml", "missing-file"),
        ("{assets}/walk/hall.ply", "not-a-scene"),
    ):
        refused = problem(submit(studio, path), 422, "broken-scene")
        assert refused["code"] == code
        assert "root:" not in refused["detail"]  # nothing of the file is shown
    for path, more in (("x" * 5000, {}), ("a\0b", {}), ("{assets}/walk", {"scene": "x"})):
        problem(submit(studio, path, **more), 422, "invalid-request")
    # A list of files that the service has not made
    forged = zipped(
        {LIST_NAME: '{"placed": 1, "entry": "a/s.xml", "files": {}}', "a/s.xml": scene()}
    )
    sent = studio.post("/v1/jobs", files={"scene": ("a.zip", forged)})
    assert "the service alone makes" in problem(sent, 422, "broken-scene")["detail"]
    # A parameter cannot lead out either
    out = '{"parameters": {"mesh": "/etc/passwd"}}'
    assert (
        problem(submit(studio, "{assets}/walk", out), 422, "broken-scene")["code"] == "path-escape"
    )
    # Nor can there be more tags than a job may have
    tags = json.dumps({"requires": [f"t{number}" for number in range(16)]})
    assert (
        "has 17 tags"
        in problem(submit(studio, "{assets}/walk", tags), 422, "invalid-spec")["detail"]
    )
    # A service without roots says so
    refused = problem(submit(http, "{assets}/walk"), 422, "invalid-request")
    assert "PLATEAU_SCENE_ROOTS" in refused["detail"]


def test_a_file_that_cannot_be_read_is_no_error_of_the_service(
    studio: httpx.Client, assets: Path
) -> None:
    (assets / "walk" / "hall.ply").unlink()
    os.mkfifo(assets / "walk" / "hall.ply")
    assert problem(submit(studio, "{assets}/walk"), 422, "broken-scene")["code"] == "missing-file"
