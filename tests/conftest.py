"""What most tests need: a real Redis, empty, and a blob store, empty."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import redis

from farm.blobs import Blobs
from farm.embedded import EmbeddedRedis
from farm.redis_link import connect

pytest.register_assert_rewrite("tests.support")


@pytest.fixture(scope="session")
def embedded_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    server = EmbeddedRedis(tmp_path_factory.mktemp("redis"))
    yield server
    server.stop()


@pytest.fixture
def redis_url(embedded_redis: EmbeddedRedis) -> str:
    client = connect(embedded_redis.url)
    client.flushall()
    client.close()
    return embedded_redis.url


@pytest.fixture
def client(redis_url: str) -> Iterator[redis.Redis]:
    client = connect(redis_url)
    yield client
    client.close()


@pytest.fixture
def store(tmp_path: Path) -> Blobs:
    return Blobs(str(tmp_path / "blobs"))
