"""Conditional GET: who has an image, a curve or a slice already is not sent it again."""

import hashlib
import time

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.redis import keys
from plateau.service.api.http.etags import Known
from tests.support.api_calls import problem
from tests.support.farms.staged_job import PARTIAL, StagedJob

IMAGES = ("image.png", "image.exr", "difference.png")
KEPT = ("etag", "cache-control")


@pytest.fixture
def job(client: redis.Redis, api_store: Blobs) -> StagedJob:
    """A job that renders, with a point and its pictures."""
    job = StagedJob(client)
    job.commit(4)
    job.point(100, 12, slope=0.5)
    for name in IMAGES:
        job.picture(api_store, name, name.encode() * 1000)
    return job


def unread(store: Blobs, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every look into the blob store fail the test."""

    def fail(name: str) -> None:
        raise AssertionError(f"{name} was asked for")

    monkeypatch.setattr(store, "chunks", fail)
    monkeypatch.setattr(store, "size", fail)


class TestAnImage:
    def test_is_not_read_for_who_has_it(
        self, http: httpx.Client, job: StagedJob, api_store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        paths = {name: f"/v1/jobs/{job.id}/{name}" for name in IMAGES}
        found = {name: http.get(path) for name, path in paths.items()}
        unread(api_store, monkeypatch)
        for name, first in found.items():
            assert int(first.headers["content-length"]) == len(first.content) == len(name) * 1000
            assert first.headers["etag"].startswith('"')  # strong
            again = http.get(paths[name], headers={"If-None-Match": first.headers["etag"]})
            assert (again.status_code, again.content) == (304, b"")
            # And says of itself what the whole answer said
            assert {name: again.headers.get(name) for name in KEPT} == {
                name: first.headers.get(name) for name in KEPT
            }
        # Another of its set is none of them
        monkeypatch.undo()
        tag = {"If-None-Match": found["image.png"].headers["etag"]}
        assert http.get(paths["difference.png"], headers=tag).status_code == 200

    def test_has_another_tag_once_another_is_shown(
        self, http: httpx.Client, client: redis.Redis, job: StagedJob, api_store: Blobs
    ) -> None:
        path = f"/v1/jobs/{job.id}/image.png"
        old = http.get(path).headers["etag"]
        api_store.put(f"jobs/{job.id}/results/0000200-1/image.png", b"better")
        digest = hashlib.sha256(b"better").hexdigest()
        client.hset(keys.job(job.id), "results", f"jobs/{job.id}/results/0000200-1")
        client.hset(keys.job(job.id, "digests"), "results/0000200-1/image.png", digest)
        answer = http.get(path, headers={"If-None-Match": old})
        assert (answer.status_code, answer.content) == (200, b"better")
        assert answer.headers["etag"] == '"0000200-1-image.png"'

    def test_may_be_kept_for_a_day_once_it_is_final(
        self, http: httpx.Client, job: StagedJob
    ) -> None:
        path = f"/v1/jobs/{job.id}/image.png"
        assert http.get(path).headers["cache-control"] == "no-cache"
        job.end()
        # The final one is not written yet
        assert http.get(path).headers["cache-control"] == "no-cache"
        job.finish()
        final = http.get(path)
        assert final.headers["cache-control"] == "private, max-age=86400"
        again = http.get(path, headers={"If-None-Match": final.headers["etag"]})
        assert again.headers["cache-control"] == "private, max-age=86400"

    def test_that_is_not_there_matches_nothing(
        self, http: httpx.Client, client: redis.Redis
    ) -> None:
        job = StagedJob(client)
        answer = http.get(f"/v1/jobs/{job.id}/image.png", headers={"If-None-Match": "*"})
        problem(answer, 404, "no-image-yet")

    def test_comes_whole_though_a_part_is_asked_for(
        self, http: httpx.Client, job: StagedJob
    ) -> None:
        answer = http.get(f"/v1/jobs/{job.id}/image.exr", headers={"Range": "bytes=0-9"})
        assert (answer.status_code, len(answer.content)) == (200, 9000)
        assert answer.headers["accept-ranges"] == "none"


class TestTheCurve:
    def test_is_sent_again_once_it_has_another_point(
        self, http: httpx.Client, client: redis.Redis, job: StagedJob
    ) -> None:
        # It is tagged before its first point, too
        path = f"/v1/jobs/{StagedJob(client).id}/curve"
        for tag in (http.get(path).headers["etag"], "*"):
            assert http.get(path, headers={"If-None-Match": tag}).status_code == 304
        path = f"/v1/jobs/{job.id}/curve"
        first = http.get(path)
        known = {"If-None-Match": first.headers["etag"]}
        again = http.get(path, headers=known)
        assert (again.status_code, again.content) == (304, b"")
        assert {name: again.headers[name] for name in KEPT} == {
            name: first.headers[name] for name in KEPT
        }
        job.commit(4)
        job.point(200, 30, slope=0.25)
        longer = http.get(path, headers=known)
        assert len(longer.json()["points"]) == 2
        assert longer.headers["etag"] != first.headers["etag"]

    def test_is_not_taken_for_its_other_form(self, http: httpx.Client, job: StagedJob) -> None:
        tag = http.get(f"/v1/jobs/{job.id}/curve").headers["etag"]
        as_csv = http.get(f"/v1/jobs/{job.id}/curve.csv", headers={"If-None-Match": tag})
        assert as_csv.status_code == 200
        assert as_csv.headers["etag"] != tag


def test_a_slice_is_tagged_by_its_hash(
    http: httpx.Client, client: redis.Redis, api_store: Blobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = StagedJob(client, keep_slices=True)
    job.commit()
    api_store.put(job.slice_blob(0), PARTIAL)
    path = f"/v1/jobs/{job.id}/slices/0.exr"
    answer = http.get(path)
    assert answer.content == PARTIAL
    assert answer.headers["etag"] == f'"{hashlib.sha256(PARTIAL).hexdigest()}"'
    assert answer.headers["content-length"] == "7"
    unread(api_store, monkeypatch)
    again = http.get(path, headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304


TAG = '"0000100-1-image.png"'


def test_a_tag_is_found_in_a_list_and_nothing_in_what_is_none() -> None:
    for lines in (
        *([TAG], [f"W/{TAG}"], [f'"other", {TAG}'], [f'"a,b",W/"c" ,, {TAG},'], [f" \t{TAG} "]),
        ['"other"', TAG],  # a list may be spread over several lines
        [" * "],  # which names whatever there is
    ):
        assert Known(tuple(lines)).has(TAG), lines
    for lines in ([], [""], [TAG.strip('"')], ['"other"']):
        assert not Known(tuple(lines)).has(TAG), lines


@pytest.mark.parametrize("text", ['"a",' * 16_000 + "x", ", " * 30_000 + "x", "W/" * 30_000])
def test_a_hostile_list_is_read_in_no_time(text: str) -> None:
    started = time.process_time()
    assert not Known((text,)).has(TAG)
    assert time.process_time() - started < 1.0
