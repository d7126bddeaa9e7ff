"""A job's curve, ledger, images and events over HTTP."""

import csv
import json
from collections.abc import Iterator

import httpx
import pytest
import redis

from plateau.client.watching import parse_events
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.errors import CorruptPartial
from plateau.farm.model.job import Event
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.picture.films import checked_partial
from tests.support.api_calls import problem
from tests.support.farms.staged_job import StagedJob


def events(http: httpx.Client, job_id: str, **headers: str) -> Iterator[Event]:
    with http.stream("GET", f"/v1/jobs/{job_id}/events", headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield from parse_events(answer.iter_lines())


def test_the_curve_comes_as_csv(http: httpx.Client, client: redis.Redis) -> None:
    job = StagedJob(client, watch=[{"name": "fixed"}])
    job.commit(8)
    job.point(100, 0)
    job.point(200, 30, slope=0.25)
    answer = http.get(f"/v1/jobs/{job.id}/curve.csv")
    assert answer.headers["content-type"].startswith("text/csv")
    first, second = csv.DictReader(answer.text.splitlines())
    assert (first["spp"], first["visible_pixels"], first["slope"]) == ("100", "0", "")
    found = (second["slope"], second["reverse_value"], second["reverse_stop"])
    assert found == ("0.25", "0.25", "false")


def test_a_slice_is_a_partial_whatever_its_worker_said(
    http: httpx.Client, client: redis.Redis, store: Blobs
) -> None:
    # Given a ledger that names what is no partial
    job, secret = StagedJob(client, keep_slices=True), blobs.scene("0" * 64)
    job.commit()
    store.put(secret, b"a scene")
    record = {**Jobs(client).ledger(job.id)[0], "blob": secret}
    stored = json.dumps({"at": record["at"], "record": json.dumps(record)})
    client.hset(keys.job(job.id, "ledger"), "0", stored)
    # Then neither the API nor a monitor reads it
    problem(http.get(f"/v1/jobs/{job.id}/slices/0.exr"), 404, "unknown-slice")
    with pytest.raises(CorruptPartial, match="no partial's name"):
        checked_partial(store, secret, record["sha256"])


class TestImages:
    def test_come_as_they_are_stored(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = StagedJob(client)
        picture = bytes(range(256)) * 17_000  # more than one piece
        names = ("image.png", "image.exr", "difference.png", "noise.png", "quality.png")
        for place, name in enumerate(names):
            job.picture(api_store, name, picture[place:])
            answer = http.get(f"/v1/jobs/{job.id}/{name}")
            assert answer.content == picture[place:]
            media_type = "image/x-exr" if name.endswith(".exr") else "image/png"
            assert answer.headers["content-type"] == media_type
            assert answer.headers["cache-control"] == "no-cache"

    def test_are_missed_in_words(self, http: httpx.Client, client: redis.Redis) -> None:
        job = StagedJob(client)
        problem(http.get(f"/v1/jobs/{job.id}/other.png"), 404, "unknown-path")
        found = problem(http.get(f"/v1/jobs/{job.id}/image.png"), 404, "no-image-yet")
        assert "a moment after its first samples" in found["detail"]
        assert found["state"] == "queued"
        job.commit()
        job.end(JobState.FAILED, "no plugin of that name")
        found = problem(http.get(f"/v1/jobs/{job.id}/image.png"), 404, "no-image-yet")
        assert "failed and left no image: no plugin of that name" in found["detail"]

    def test_are_there_before_there_is_a_difference_to_be_shown(
        self, http: httpx.Client, client: redis.Redis, api_store: Blobs
    ) -> None:
        job = StagedJob(client, step=200)
        job.commit()
        # Given an image, and no point of the curve yet
        job.picture(api_store, "image.png", b"a picture")
        found = problem(http.get(f"/v1/jobs/{job.id}/difference.png"), 404, "no-image-yet")
        assert "has an image of 100 spp, but no difference map yet" in found["detail"]
        assert "with the first point of its curve, at 200 spp" in found["detail"]
        found = problem(http.get(f"/v1/jobs/{job.id}/noise.png"), 404, "no-image-yet")
        assert "whose noise nobody knows yet: that takes two slices" in found["detail"]
        found = problem(http.get(f"/v1/jobs/{job.id}/quality.png"), 404, "no-image-yet")
        assert "no rule of job" in found["detail"]
        # When the job ends so
        job.end(JobState.CANCELLED, "cancelled by a user")
        found = problem(http.get(f"/v1/jobs/{job.id}/difference.png"), 404, "no-image-yet")
        assert (
            "is cancelled and has an image of 100 spp, but no difference map: " in found["detail"]
        )
        assert "ended before the first point of its curve, at 200 spp" in found["detail"]
        # A cap may come before a step
        job = StagedJob(client, step=200, max_spp=150)
        job.picture(api_store, "image.png", b"a picture")
        found = problem(http.get(f"/v1/jobs/{job.id}/difference.png"), 404, "no-image-yet")
        assert "at 150 spp" in found["detail"]


def test_events_go_on_from_the_last_one_seen(http: httpx.Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    job.commit(2)
    job.end()
    job.finish()
    everything = list(events(http, job.id))
    for seen, event in enumerate(everything[:-1]):
        rest = list(events(http, job.id, **{"Last-Event-ID": event.id}))
        assert rest == everything[seen + 1 :]
    query = http.get(f"/v1/jobs/{job.id}/events?after={everything[-2].id}")
    assert [one.type for one in parse_events(query.text.splitlines())] == ["finished"]
    last = {"Last-Event-ID": everything[-1].id}
    answer = http.get(f"/v1/jobs/{job.id}/events", headers=last)
    assert answer.status_code == 204  # on which a browser does not come back


def test_a_slice_that_can_never_be_is_unknown(http: httpx.Client, client: redis.Redis) -> None:
    job = StagedJob(client)
    last = job.spec.max_spp // job.spec.slice_spp - 1
    assert http.get(f"/v1/jobs/{job.id}/log?slice={last}").status_code == 200
    found = problem(http.get(f"/v1/jobs/{job.id}/log?slice={last + 1}"), 404, "unknown-slice")
    assert f"no slice {last + 1}" in found["detail"]
    problem(http.get(f"/v1/jobs/{job.id}/log?slice=-1"), 422, "invalid-request")
    problem(http.get(f"/v1/jobs/{job.id}/log?slice=x"), 422, "invalid-request")
    problem(http.get(f"/v1/jobs/{job.id}/log?slice={10**30}"), 422, "invalid-request")
