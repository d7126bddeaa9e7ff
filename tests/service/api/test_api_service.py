"""The API itself: health, who may call it, what it says of errors, and how it bears outages."""

import re
import threading
from pathlib import Path

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.farm.redis.url import is_loopback
from plateau.service.api.problems import problem as problems
from plateau.service.api.process import CannotListen, listen
from tests.service.api.routes.test_jobs import problem, submit
from tests.support.farms.live_api import live_api
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until


def test_it_says_that_it_lives_and_is_ready(http: httpx.Client) -> None:
    assert http.get("/healthz").json() == {"status": "ok"}
    assert http.get("/readyz").json() == {"status": "ok"}


def test_it_lists_the_workers(http: httpx.Client, redis_url: str) -> None:
    assert http.get("/v1/workers").json() == {"workers": []}
    about = {
        "id": "w1",
        "host": "here",
        "pid": 1,
        "variants": ["scalar_rgb"],
        "threads": 2,
        "job": None,
        "slice": None,
        "slices_done": 3,
        "samples_per_s": 1e6,
        "last_error": None,
        "trouble": "cannot write into /var/cache: No space left on device",
        "started_at": "2026-01-01T00:00:00Z",
    }
    SliceQueue(connect(redis_url), "w1", lease_s=15).heartbeat(about, ())
    [worker] = http.get("/v1/workers").json()["workers"]
    assert (worker["id"], worker["slices_done"]) == ("w1", 3)
    assert worker["trouble"].startswith("cannot write into")


class TestErrors:
    def test_of_the_framework_are_problems_too(self, http: httpx.Client) -> None:
        problem(http.get("/v2/jobs"), 404, "unknown-path")
        problem(http.delete("/v1/jobs"), 405, "method-not-allowed")

    def test_have_types_that_can_be_looked_up(self, http: httpx.Client) -> None:
        for slug, kind in problems.TYPES.items():
            found = http.get(f"/problems/{slug}").json()
            assert found == {"type": kind.uri, "status": kind.status, "title": kind.title}
        problem(http.get("/problems/bad-mood"), 404, "unknown-path")

    def test_are_in_the_description(self, http: httpx.Client) -> None:
        described = http.get("/openapi.json").json()
        answers = described["paths"]["/v1/jobs"]["post"]["responses"]
        assert "/problems/broken-scene" in answers["422"]["description"]
        assert "application/problem+json" in answers["413"]["content"]
        form = described["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]
        spec = form["multipart/form-data"]["schema"]["properties"]["spec"]
        assert {"$ref": "#/components/schemas/JobSpec"} in spec["oneOf"]
        assert "required" not in described["components"]["schemas"]["JobSpec"]
        assert http.get("/docs").status_code == 200


class TestStrangers:
    """A page of another site, opened in a browser on this machine."""

    @pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example"])
    def test_are_refused_under_a_name_of_their_own(self, http: httpx.Client, host: str) -> None:
        problem(http.get("/v1/jobs", headers={"Host": host}), 403, "foreign-host")

    @pytest.mark.parametrize("header", ["X-Forwarded-For", "Forwarded", "X-Real-IP"])
    def test_are_refused_through_a_proxy(self, http: httpx.Client, header: str) -> None:
        said = problem(http.get("/v1/jobs", headers={header: "10.1.2.3"}), 403, "foreign-host")
        assert "came through a proxy" in said["detail"]

    @pytest.mark.parametrize("origin", ["http://evil.example", "http://localhost:1", "null"])
    def test_are_refused_from_their_own_pages(self, http: httpx.Client, origin: str) -> None:
        problem(submit(http, headers={"Origin": origin}), 403, "foreign-origin")

    def test_are_told_from_the_api_s_own_pages(self, http: httpx.Client) -> None:
        origin = str(http.base_url).rstrip("/")
        assert submit(http, headers={"Origin": origin}).status_code == 201

    @pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "127.9.9.9", "::1", "[::1]"])
    def test_are_not_this_machine(self, host: str) -> None:
        assert is_loopback(host)

    @pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.0.1", "example.org", ""])
    def test_can_be_other_machines(self, host: str) -> None:
        assert not is_loopback(host)


def test_a_taken_port_is_said_to_be(session_api: str) -> None:
    with pytest.raises(CannotListen, match=r"(?i)address already in use; .*--port"):
        listen("127.0.0.1", int(session_api.rpartition(":")[2]))


class TestWithoutRedis:
    def test_it_answers_503_and_lives(self, tmp_path: Path) -> None:
        with (
            live_api(f"unix://{tmp_path}/none.sock", Blobs(str(tmp_path))) as url,
            httpx.Client(base_url=url, trust_env=False, timeout=60) as http,
        ):
            for path in ("/v1/jobs", "/v1/jobs/0123456789ab", "/readyz", "/v1/workers"):
                answer = http.get(path)
                assert (
                    "Redis cannot be reached" in problem(answer, 503, "store-unavailable")["detail"]
                )
                assert int(answer.headers["retry-after"]) > 0
            problem(submit(http), 503, "store-unavailable")
            assert http.get("/healthz").status_code == 200

    def test_a_stream_of_events_survives_its_restart(self, tmp_path: Path) -> None:
        # Given a service and someone who watches a job
        port = _free_port()
        before = EmbeddedRedis(tmp_path / "redis")
        url = _over_tcp(before, port)
        job = StagedJob(connect(url))
        heard: list[str] = []
        with live_api(url, Blobs(str(tmp_path / "blobs"))) as api:

            def watch() -> None:
                with httpx.stream("GET", f"{api}/v1/jobs/{job.id}/events", timeout=30) as answer:
                    for line in answer.iter_lines():
                        heard.extend(re.findall(r"^event: (\w+)", line))

            watcher = threading.Thread(target=watch)
            watcher.start()
            until(lambda: heard == ["state"])
            # If Redis goes, and comes back
            before.stop()
            after = EmbeddedRedis(tmp_path / "redis")
            _over_tcp(after, port)
            # Then what happens since is heard, once
            try:
                job.commit()
                job.end()
                job.finish()
                watcher.join(60)
            finally:
                after.stop()
        assert heard == ["state", "state", "slice", "state", "image", "finished"]


def _free_port() -> int:
    with listen("127.0.0.1", 0) as listener:
        return int(listener.getsockname()[1])


def _over_tcp(server: EmbeddedRedis, port: int) -> str:
    """A URL of the server that stays the same after a restart."""
    client: redis.Redis = connect(server.url)
    client.config_set("port", port)
    client.close()
    return f"redis://127.0.0.1:{port}"


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
