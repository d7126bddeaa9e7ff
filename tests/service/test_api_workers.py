"""Steering workers over HTTP."""

from collections.abc import Iterator

import httpx
import pytest
import redis

from farm.api_keys import ApiKeys, KeyLimits, Role
from farm.blobs import Blobs
from farm.queue import SliceQueue
from service.key_guard import Access
from tests.farm.test_workers import about
from tests.service.test_api_jobs import problem
from tests.support.live_api import live_api

LIMITS = KeyLimits(requests_per_minute=1200, burst=200, upload_bytes=None, open_jobs=None)


@pytest.fixture
def worker(client: redis.Redis) -> str:
    SliceQueue(client, "w-1", 60).heartbeat(about("w-1"), ())
    return "w-1"


def drained(http: httpx.Client) -> list[bool]:
    return [one["drained"] for one in http.get("/v1/workers").json()["workers"]]


def test_a_worker_is_drained_and_let_work(http: httpx.Client, worker: str) -> None:
    for _ in range(2):
        answer = http.post(f"/v1/workers/{worker}/drain")
        assert (answer.status_code, answer.json()["workers"][0]["drained"]) == (202, True)
    assert drained(http) == [True]
    assert http.post(f"/v1/workers/{worker}/resume").status_code == 202
    assert drained(http) == [False]


def test_one_that_does_not_live_is_a_problem(http: httpx.Client) -> None:
    problem(http.post("/v1/workers/nobody/drain"), 404, "unknown-worker")
    problem(http.post("/v1/workers/nobody/resume"), 404, "unknown-worker")


class TestWithKeys:
    @pytest.fixture
    def url(self, redis_url: str, api_store: Blobs) -> Iterator[str]:
        with live_api(redis_url, api_store, access=Access.KEYS) as url:
            yield url

    @pytest.mark.parametrize(
        ("role", "status"), [(Role.VIEWER, 403), (Role.SUBMITTER, 403), (Role.ADMIN, 202)]
    )
    def test_it_takes_an_admin(
        self, client: redis.Redis, url: str, worker: str, role: Role, status: int
    ) -> None:
        _, key = ApiKeys(client).create("page", role, LIMITS)
        headers = {"Authorization": f"Bearer {key}"}
        answer = httpx.post(f"{url}/v1/workers/{worker}/drain", headers=headers, trust_env=False)
        assert answer.status_code == status
