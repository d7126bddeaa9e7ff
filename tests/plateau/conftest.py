"""A live API and a client of it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.redis.embedded import EmbeddedRedis
from tests.support.farms.live_api import live_api
from tests.support.scenes.bundles import scene


@pytest.fixture(scope="session")
def shared_store(tmp_path_factory: pytest.TempPathFactory) -> Blobs:
    return Blobs(str(tmp_path_factory.mktemp("api-blobs")))


@pytest.fixture(scope="session")
def shared_api(embedded_redis: EmbeddedRedis, shared_store: Blobs) -> Iterator[str]:
    """An API that all tests share: its first answer takes it a third of a second."""
    with live_api(embedded_redis.url, shared_store) as url:
        yield url


@pytest.fixture
def api(shared_api: str, redis_url: str) -> str:
    """The shared API, with nothing in its Redis."""
    return shared_api


@pytest.fixture
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Blobs:
    """The API's blob store where a test has the API, else an empty one."""
    if "api" in request.fixturenames:
        shared: Blobs = request.getfixturevalue("shared_store")
        return shared
    return Blobs(str(tmp_path / "blobs"))


@pytest.fixture
def _service(api: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The API is the service that commands ask."""
    monkeypatch.setenv("PLATEAU_URL", api)


@pytest.fixture
def box(tmp_path: Path) -> str:
    path = tmp_path / "box.xml"
    path.write_bytes(scene())
    return str(path)


@pytest.fixture
def plateau(api: str) -> Iterator[Client]:
    with Client(api) as plateau:
        yield plateau
