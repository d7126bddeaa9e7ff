"""A live API and a client of it."""

from collections.abc import Iterator

import pytest

from farm.blobs import Blobs
from plateau.client import Client
from tests.support.live_api import live_api


@pytest.fixture
def api(redis_url: str, store: Blobs) -> Iterator[str]:
    with live_api(redis_url, store) as url:
        yield url


@pytest.fixture
def plateau(api: str) -> Iterator[Client]:
    with Client(api) as plateau:
        yield plateau
