"""The API itself: health, who may call it, what it says of errors, and how it bears outages."""

import json
import re
import socket
import threading
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.service.api.problems import catalogue as problems
from tests.support.api_calls import problem, submit
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until


def test_it_says_that_it_lives_and_is_ready(http: httpx.Client) -> None:
    assert http.get("/healthz").json() == {"status": "ok"}
    assert http.get("/readyz").json() == {"status": "ok"}


def test_types_of_problems_can_be_looked_up(http: httpx.Client) -> None:
    for slug, kind in problems.TYPES.items():
        found = http.get(f"/problems/{slug}").json()
        assert found == {"type": kind.uri, "status": kind.status, "title": kind.title}
    problem(http.get("/problems/bad-mood"), 404, "unknown-path")


class TestStrangers:
    """A page of another site, opened in a browser on this machine."""

    def test_are_refused_through_a_proxy(self, http: httpx.Client) -> None:
        for header in ("X-Forwarded-For", "Forwarded", "X-Real-IP"):
            said = problem(http.get("/v1/jobs", headers={header: "10.1.2.3"}), 403, "foreign-host")
            assert "came through a proxy" in said["detail"]

    def test_are_told_from_the_api_s_own_pages(self, http: httpx.Client) -> None:
        for origin in ("http://evil.example", "http://localhost:1", "null"):
            problem(submit(http, headers={"Origin": origin}), 403, "foreign-origin")
        origin = str(http.base_url).rstrip("/")
        assert submit(http, headers={"Origin": origin}).status_code == 201


def test_a_stream_of_events_survives_a_restart_of_redis(tmp_path: Path) -> None:
    # Given a service and someone who watches a job
    before = EmbeddedRedis(tmp_path / "redis")
    job = StagedJob(connect(before.url, 120.0))
    heard: list[str] = []
    with live_api(before.url, Blobs(str(tmp_path / "blobs"))) as api:

        def watch() -> None:
            with httpx.stream("GET", f"{api}/v1/jobs/{job.id}/events", timeout=600) as answer:
                for line in answer.iter_lines():
                    heard.extend(re.findall(r"^event: (\w+)", line))

        watcher = threading.Thread(target=watch)
        watcher.start()
        until(lambda: heard == ["state"])
        # If Redis goes, and comes back
        before.stop()
        after = EmbeddedRedis(tmp_path / "redis")
        assert after.url == before.url
        # Then what happens since is heard, once
        try:
            job.commit()
            job.end()
            job.finish()
            watcher.join(60)
        finally:
            after.stop()
    assert heard == ["state", "state", "slice", "state", "image", "finished"]


def test_a_stopping_api_does_not_wait_for_who_watches(
    client: redis.Redis, redis_url: str, tmp_path: Path
) -> None:
    job = StagedJob(client)
    watching = threading.Event()
    # An API that would not cut off who watches before this test is over
    with live_api(redis_url, Blobs(str(tmp_path)), grace_s=600) as url:

        def watch() -> None:
            with httpx.stream("GET", f"{url}/v1/jobs/{job.id}/events", timeout=60) as answer:
                for _ in answer.iter_lines():
                    watching.set()

        watcher = threading.Thread(target=watch)
        watcher.start()
        assert watching.wait(60)
    watcher.join(60)
    assert not watcher.is_alive()


HEAD = (
    "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: multipart/form-data; boundary=b\r\n"
    "Content-Length: 100000\r\n\r\n"
    '--b\r\nContent-Disposition: form-data; name="scene"; filename="a.xml"\r\n\r\n<scene'
)


def test_an_upload_that_is_cut_off_is_answered(redis_url: str, store: Blobs) -> None:
    with live_api(redis_url, store, grace_s=1) as url:
        address = urlsplit(url)
        upload = socket.create_connection((str(address.hostname), address.port or 0), timeout=30)
        # Given an upload that will take longer than an API that stops waits for
        upload.sendall(HEAD.encode())
        with httpx.Client(base_url=url, verify=False, timeout=60) as http:
            assert http.get("/healthz").status_code == 200  # it has come that far
    with upload:
        said = b"".join(iter(lambda: upload.recv(65536), b""))
    # Then it is told to try again
    head, _, body = said.decode().partition("\r\n\r\n")
    assert head.startswith("HTTP/1.1 503 ")
    assert "retry-after: " in head.lower()
    assert json.loads(body)["detail"].startswith("the API stops; try again")
