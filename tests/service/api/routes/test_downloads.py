"""All that jobs have come to, as one zip."""

import io
import json
import threading
import zipfile
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from xml.etree import ElementTree as ET
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import httpx
import numpy as np
import pytest
import redis
from PIL import Image

from plateau.farm.blobs.store import Blobs
from plateau.farm.images.exr import decode_image
from plateau.farm.model.job import utc_now
from plateau.metric import encode_srgb
from plateau.service.api.results.zip_stream import ZipEntry, zipped
from tests.support.api_calls import problem
from tests.support.farms.every_time import save_every_time
from tests.support.farms.live_api import live_http
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob

#: Larger than what is read of a blob at a time.
EXR = bytes(range(256)) * 20_000


def converged(client: redis.Redis, store: Blobs, **spec: object) -> StagedJob:
    job = StagedJob(client, **spec)
    job.commit(8)
    job.point(100, 0)
    job.point(200, 30, slope=0.25)
    job.picture(store, "image.png", b"an image")
    job.picture(store, "difference.png", b"a map")
    job.picture(store, "image.exr", EXR, was=EXR)
    job.preview(store, 100, b"a preview")
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
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == [
            *("image.exr", "image.png", "difference.png", "previews/000100.png"),
            *("curve.csv", "curve.svg", "summary.txt", "summary.json"),
        ]
        assert archive.read("image.exr") == EXR
        assert archive.read("previews/000100.png") == b"a preview"
        assert archive.read("curve.csv") == http.get(f"/v1/jobs/{job.id}/curve.csv").content
        assert ET.fromstring(archive.read("curve.svg")).tag.endswith("svg")
        assert b"converged" in archive.read("summary.txt")
        about = json.loads(archive.read("summary.json"))
        assert (about["id"], len(about["curve"])) == (job.id, 2)
        assert about["files"] == archive.namelist()
        # Text is compressed, images are not; anybody may read what is unpacked
        assert archive.getinfo("image.exr").compress_type == ZIP_STORED
        assert archive.getinfo("summary.txt").compress_type == ZIP_DEFLATED
        assert {one.external_attr >> 16 for one in archive.infolist()} == {0o644}

    @pytest.mark.parametrize("name", ["image.exr", "noise.png"])
    def test_names_what_is_damaged_and_has_the_rest(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs, name: str
    ) -> None:
        job = StagedJob(client)
        # Without an image it tells why
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == ["summary.txt", "summary.json"]
        job.picture(api_store, "image.png", b"an image")
        job.picture(api_store, name, b"spoiled", was=b"whole")
        archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
        assert archive.namelist() == ["image.png", "summary.txt", "summary.json", "damaged.txt"]
        assert archive.read("damaged.txt").decode().startswith(name)


def test_the_images_of_a_running_job_are_of_the_same_samples(
    farm: NoiseFarm, redis_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a job whose newest images are replaced all the time while somebody fetches them
    save_every_time(monkeypatch)
    job = farm.submit(step=10, slice_spp=10, max_spp=9000, rule={"name": "fixed", "spp": 9000})
    spps: set[str] = set()
    is_over = threading.Event()

    def look(http: httpx.Client) -> None:
        while not is_over.is_set():
            archive = fetched(http, f"/v1/jobs/{job.id}/results.zip")
            if "image.png" not in archive.namelist():
                continue
            # The PNG of each zip is made of its EXR
            with Image.open(io.BytesIO(archive.read("image.png"))) as picture:
                shown = np.asarray(picture)
                assert np.array_equal(encode_srgb(decode_image(archive.read("image.exr"))), shown)
                spps.add(picture.info["plateau:spp"])

    with live_http(redis_url, farm.store) as http, ThreadPoolExecutor(1) as pool:
        looking = pool.submit(look, http)
        try:
            with farm.monitor():
                farm.work(lambda: len(spps) > 2 or looking.done())
        finally:
            is_over.set()
        looking.result()


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
        # Those of a batch are in its order
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


def test_a_large_file_is_never_held_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    # Given a file in pieces that is so large that zips have another format for it
    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 1 << 20)
    piece, pieces = bytes(1 << 16), 1 << 7
    entry = ZipEntry("a.exr", repeat(piece, pieces), len(piece) * pieces, utc_now())
    chunks = list(zipped([entry]))
    assert max(map(len, chunks)) < 1 << 17
    archive = ZipFile(io.BytesIO(b"".join(chunks)))
    assert archive.read("a.exr") == piece * pieces
