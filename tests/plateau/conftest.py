"""A live API and a client of it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from tests.service.conftest import api_store as api_store
from tests.service.conftest import session_api as session_api
from tests.support.scenes.bundles import scene


@pytest.fixture
def api(session_api: str, redis_url: str) -> str:
    """The session's API, with nothing in its Redis."""
    return session_api


@pytest.fixture
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Blobs:
    """The API's blob store where a test has the API, else an empty one."""
    if "api" in request.fixturenames:
        return request.getfixturevalue("api_store")
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
    with Client(api, patience_s=120) as plateau:
        yield plateau
