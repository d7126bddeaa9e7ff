"""Stored files whose bytes were damaged are refused in words; they are never served."""

import base64
import hashlib
from pathlib import Path

import httpx
import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from tests.support.api_calls import problem
from tests.support.farms.staged_job import PARTIAL, StagedJob


@pytest.fixture
def job(client: redis.Redis, api_store: Blobs) -> StagedJob:
    """A finished job of which everything is kept."""
    job = StagedJob(client, keep_slices=True)
    job.commit()
    api_store.put(job.slice_blob(0), PARTIAL)
    for name in ("image.png", "image.exr", "difference.png"):
        job.picture(api_store, name, f"{client.time()} {name}".encode())
    job.preview(api_store, 100, b"a preview")
    job.end()
    job.finish()
    return job


def spoil(store: Blobs, blob: str) -> None:
    """Turn a byte in the middle of a stored file, as an old disk does."""
    path = Path(store.where) / blob
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x40
    path.write_bytes(content)


def test_each_is_refused_until_it_is_whole_again(
    http: httpx.Client, job: StagedJob, api_store: Blobs, caplog: pytest.LogCaptureFixture
) -> None:
    for path, blob in (
        *((name, f"{job.pictures}/{name}") for name in ("image.png", "image.exr")),
        ("previews/100.png", blobs.preview(job.id, 100)),
        ("slices/0.exr", job.slice_blob(0)),
    ):
        written = api_store.get(blob)
        spoil(api_store, blob)
        answer = http.get(f"/v1/jobs/{job.id}/{path}")
        assert f"{blob} is damaged or lost" in problem(answer, 500, "spoiled-file")["detail"]
        assert http.head(f"/v1/jobs/{job.id}/{path}").status_code == 500
        assert f"{blob} is damaged" in caplog.text
        # Where somebody brings it back, it is served with the digest that RFC 9530 has
        api_store.put(blob, written)
        answer = http.get(f"/v1/jobs/{job.id}/{path}")
        assert answer.content == written
        digest = base64.b64encode(hashlib.sha256(written).digest()).decode()
        assert answer.headers["repr-digest"] == f"sha-256=:{digest}:"


def test_one_that_is_lost_is_said_to_be(
    http: httpx.Client, job: StagedJob, api_store: Blobs
) -> None:
    api_store.delete(f"{job.pictures}/image.png", blobs.preview(job.id, 100), job.slice_blob(0))
    for path, status, slug in (
        ("image.png", 500, "spoiled-file"),
        ("previews/100.png", 404, "unknown-point"),
        ("previews/30.png", 404, "unknown-point"),
        ("slices/0.exr", 404, "unknown-slice"),
    ):
        problem(http.get(f"/v1/jobs/{job.id}/{path}"), status, slug)
