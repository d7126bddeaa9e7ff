"""A farm without Mitsuba, with its API, its monitor and its page; and visitors who look at it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import redis
from playwright.sync_api import Browser, Page

from tests.support.browser import Visitor, chromium
from tests.support.live_api import live_api
from tests.support.noise_farm import NoiseFarm


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium, closed before other tests come: while it runs, nobody can call `asyncio.run`."""
    with chromium() as browser:
        yield browser


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


@pytest.fixture
def url(redis_url: str, farm: NoiseFarm) -> Iterator[str]:
    with live_api(redis_url, farm.store) as url:
        yield url


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
