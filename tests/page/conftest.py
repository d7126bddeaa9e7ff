"""A farm without Mitsuba, with its API, its monitor and its page; and visitors who look at it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import redis
from playwright.sync_api import Browser, Page

from plateau.farm.blobs.store import Blobs
from plateau.farm.model.scene_roots import read_roots
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.service.api.scene_checks.placing import Placing
from plateau.service.notices.targets import Targets
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.processes.browser import SharedChromium, Visitor

_CHROMIUM = pytest.StashKey[SharedChromium]()


@pytest.fixture(scope="session")
def shared_chromium(request: pytest.FixtureRequest) -> Iterator[SharedChromium]:
    shared = request.session.stash[_CHROMIUM] = SharedChromium()
    yield shared
    shared.close()


@pytest.fixture(scope="module")
def browser(shared_chromium: SharedChromium) -> Browser:
    return shared_chromium.browser()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Close Chromium before other tests come: while it runs, nobody can call `asyncio.run`.

    Also where the last visitor saw something go wrong: it is that test alone that is to fail.
    """
    try:
        yield
    finally:
        shared = item.session.stash.get(_CHROMIUM, None)
        if shared and (nextitem is None or Path(__file__).parent not in nextitem.path.parents):
            shared.close()


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page-farm")


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, folder: Path) -> NoiseFarm:
    return paired(NoiseFarm(client, redis_url, folder))


def paired(farm: NoiseFarm) -> NoiseFarm:
    """A farm with the blobs of another test's: this Redis has forgotten its pair."""
    mark = farm.store.mark()
    if mark is not None:
        farm.client.hset(keys.STORE, mapping={"id": mark, "paired": 1})
    return farm


#: Whom the operator of the shared farm has named.
TARGETS = Targets({"lead": "json://127.0.0.1:1", "ops": "json://127.0.0.1:1"})


@pytest.fixture(scope="session")
def shared_url(embedded_redis: EmbeddedRedis, folder: Path) -> Iterator[str]:
    """The page on an API that all tests share."""
    placing = Placing(read_roots(f"assets={folder}/assets"), folder / "hashes")
    with live_api(
        embedded_redis.url, Blobs(str(folder / "blobs")), placing=placing, targets=TARGETS
    ) as url:
        yield url


@pytest.fixture
def url(shared_url: str, farm: NoiseFarm) -> str:
    return shared_url


Visit = Callable[..., Visitor]


@pytest.fixture
def visit(browser: Browser, url: str) -> Iterator[Visit]:
    """Makes visitors; at the end, nothing may have gone wrong for any of them.

    `expected` are statuses that the API will answer them, `url` where another farm is.
    """
    visitors: list[Visitor] = []

    def visit(path: str = "/", **options: Any) -> Visitor:
        expected = options.pop("expected", set())
        visitor = Visitor(browser, options.pop("url", url), **options)
        visitor.expected = expected
        visitors.append(visitor)
        visitor.page.goto(path)
        return visitor

    yield visit
    for visitor in visitors:
        visitor.leave()


@pytest.fixture
def page(visit: Visit) -> Page:
    """The list of jobs, as the first visitor finds it."""
    return visit().page
