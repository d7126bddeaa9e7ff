"""All that jobs have come to, as one zip."""

import io
import json
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path
from xml.etree import ElementTree as ET
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import httpx
import numpy as np
import pytest
import redis
from PIL import Image

from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.model.job import utc_now
from plateau.metric import encode_srgb
from plateau.service.api.results.zip_stream import ZipEntry, zipped
from tests.service.api.routes.test_jobs import problem
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

#: Larger than what is read of a blob at a time.
EXR = bytes(range(256)) * 50_000


def converged(client: redis.Redis, store: Blobs, **spec: object) -> StagedJob:
    job = StagedJob(client, **spec)
    job.commit(8)
    job.point(100, 0)
    job.point(200, 30, slope=0.25)
    job.picture(store, "image.png", b"an image")
    job.picture(store, "difference.png", b"a map")
    job.picture(store, "image.exr", EXR, was=EXR)
    job.end()
    job.finish(200)
    return job


def fetched(http: httpx.Client, path: str) -> ZipFile:
    answer = http.get(path)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip")
    archive = ZipFile(io.BytesIO(answer.content))
    assert archive.testzip() is None
    return archive


class TestOneJob:
    def test_has_everything(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = converged(client, api_store)
        api_store.put(blobs.preview(job.id, 100), b"a preview")
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == [
            *("image.exr", "image.png", "difference.png", "previews/000100.png"),
            *("curve.csv", "curve.svg", "report.html", "summary.txt", "summary.json"),
        ]
        assert archive.read("image.exr") == EXR
        assert archive.read("previews/000100.png") == b"a preview"
        for name in ("curve.csv", "report.html"):
            assert archive.read(name) == http.get(f"/v1/jobs/{job.id}/{name}").content
        assert ET.fromstring(archive.read("curve.svg")).tag.endswith("svg")
        assert b"converged" in archive.read("summary.txt")
        about = json.loads(archive.read("summary.json"))
        assert (about["id"], len(about["curve"])) == (job.id, 2)
        assert about["files"] == archive.namelist()
        # Text is compressed, images are not; anybody may read what is unpacked
        assert archive.getinfo("image.exr").compress_type == ZIP_STORED
        assert archive.getinfo("report.html").compress_type == ZIP_DEFLATED
        assert {one.external_attr >> 16 for one in archive.infolist()} == {0o644}

    def test_without_an_image_tells_why(self, http: httpx.Client, client: redis.Redis) -> None:
        job = StagedJob(client)
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == ["report.html", "summary.txt", "summary.json"]

    @pytest.mark.parametrize("name", ["image.exr", "noise.png"])
    def test_names_what_is_damaged_and_has_the_rest(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs, name: str
    ) -> None:
        job = StagedJob(client)
        job.picture(api_store, "image.png", b"an image")
        job.picture(api_store, name, b"spoiled", was=b"whole")
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == [
            *("image.png", "report.html", "summary.txt", "summary.json", "damaged.txt"),
        ]
        assert archive.read("damaged.txt").decode().startswith(name)

    def test_is_refused_for_none(self, http: httpx.Client) -> None:
        problem(http.get("/v1/jobs/000000000000/results.zip"), 404, "unknown-job")


def test_the_images_of_a_running_job_are_of_the_same_samples(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    # Given a job whose newest images are replaced all the time while somebody fetches them
    farm = NoiseFarm(client, redis_url, tmp_path)
    job = farm.submit(step=10, slice_spp=10, max_spp=400, rule={"name": "fixed", "spp": 400})
    found: list[ZipFile] = []
    is_over = threading.Event()

    def look(http: httpx.Client) -> None:
        while not is_over.is_set():
            found.append(fetched(http, f"/v1/jobs/{job.id}/results.zip"))

    options = {"trust_env": False, "verify": False, "timeout": 60}
    with (
        live_api(redis_url, farm.store) as url,
        httpx.Client(base_url=url, **options) as http,
        ThreadPoolExecutor(1) as pool,
    ):
        looking = pool.submit(look, http)
        try:
            with farm.monitor():
                farm.render(40)
                until(lambda: farm.is_finished(job))
        finally:
            is_over.set()
        looking.result()
    # Then the PNG of each zip is made of its EXR
    spps = set()
    for archive in found:
        if "image.png" in archive.namelist():
            with Image.open(io.BytesIO(archive.read("image.png"))) as picture:
                spps.add(picture.info["plateau:spp"])
                shown = np.asarray(picture)
            assert np.array_equal(encode_srgb(decode_image(archive.read("image.exr"))), shown)
    assert len(spps) > 1


class TestSeveral:
    @pytest.fixture
    def jobs(self, client: redis.Redis, api_store: Blobs) -> list[str]:
        return [converged(client, api_store, batch="walk").id for _ in range(3)]

    def test_have_a_folder_each(self, http: httpx.Client, jobs: list[str]) -> None:
        first, _, third = jobs
        archive = fetched(http, f"/v1/results.zip?job={third}&job={first}")
        assert {name.partition("/")[0] for name in archive.namelist()} == {
            f"0000-{third}",
            f"0001-{first}",
        }
        assert archive.read(f"0001-{first}/image.exr") == EXR

    def test_of_a_batch_are_in_its_order(self, http: httpx.Client, jobs: list[str]) -> None:
        archive = fetched(http, "/v1/results.zip?batch=walk")
        images = [name for name in archive.namelist() if name.endswith("image.png")]
        assert images == [f"{place:04d}-{job}/image.png" for place, job in enumerate(jobs)]

    def test_are_refused_where_one_is_unknown_or_none_is_named(
        self, http: httpx.Client, jobs: list[str]
    ) -> None:
        unknown = f"/v1/results.zip?job={jobs[0]}&job=000000000000"
        problem(http.get(unknown), 404, "unknown-job")
        problem(http.get("/v1/results.zip"), 422, "invalid-request")
        problem(http.get("/v1/results.zip?batch=none"), 404, "unknown-batch")


def test_a_large_file_is_never_held_whole() -> None:
    # Given a file of five gigabytes in pieces, for which zips have a larger format
    piece, pieces = bytes(1 << 24), 5 << 6
    entry = ZipEntry("a.exr", repeat(piece, pieces), len(piece) * pieces, utc_now())
    sizes = [len(chunk) for chunk in zipped([entry])]
    assert sum(sizes) > 5 << 30
    assert max(sizes) < 1 << 25
