"""A live API over the session's Redis, which is empty for each test."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import redis

from plateau.farm.blobs.store import Blobs
from plateau.farm.redis.embedded import EmbeddedRedis
from tests.support.farms.live_api import http_client, live_api
from tests.support.farms.noise_farm import NoiseFarm


@pytest.fixture(scope="session")
def api_store(tmp_path_factory: pytest.TempPathFactory) -> Blobs:
    return Blobs(str(tmp_path_factory.mktemp("api-blobs")))


@pytest.fixture(scope="session")
def session_api(embedded_redis: EmbeddedRedis, api_store: Blobs) -> Iterator[str]:
    with live_api(embedded_redis.url, api_store) as url:
        yield url


@pytest.fixture
def http(session_api: str, redis_url: str) -> Iterator[httpx.Client]:
    with http_client(session_api) as http:
        yield http


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)
