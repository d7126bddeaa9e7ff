"""A list of two hundred jobs: what is asked for, and what is touched, follows what changes."""

import re
from datetime import datetime, timedelta, timezone

import pytest
import redis
from playwright.sync_api import Locator, Page, Request, expect

from plateau.farm.model.states import JobState
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

JOBS, RENDERING = 200, 10

#: Notes in `touched` the job of each row in which anything is changed.
WATCH = """() => {
  window.touched = [];
  new MutationObserver((changes) => {
    for (const { target } of changes) {
      const row = (target.closest ? target : target.parentElement).closest(".job");
      touched.push(row ? row.dataset.job : "the list");
    }
  }).observe(document.querySelector(".jobs"), {
    subtree: true, childList: true, attributes: true, characterData: true,
  });
}"""


class Looks:
    """What the page asks the API for, look by look."""

    def __init__(self, page: Page) -> None:
        self.asked: list[str] = []
        page.on("request", self._note)

    def _note(self, request: Request) -> None:
        if "/v1/" in request.url:
            self.asked.append(request.url.partition("/v1/")[2])

    @property
    def count(self) -> int:
        return sum(one == "workers" for one in self.asked)

    def wait(self, page: Page, more: int) -> None:
        """Wait until the page has looked so often again, and has shown what it saw."""
        wanted = self.count + more + 1  # then the last of them is over
        until(lambda: page.wait_for_timeout(100) or self.count >= wanted, 60)


def row(page: Page, job_id: str) -> Locator:
    return page.locator(f'[data-job="{job_id}"]')


@pytest.fixture
def rendering(farm: NoiseFarm, client: redis.Redis) -> list[StagedJob]:
    """The ten that render, made first, so that they are far down the list."""
    staged = [StagedJob(client, farm.submit(f"slow-{one}").id) for one in range(RENDERING)]
    for one in staged:
        one.commit(4)
        one.point(100, 3)
    return staged


@pytest.fixture
def queued(farm: NoiseFarm, rendering: list[StagedJob]) -> list[str]:
    return [farm.submit(f"job-{one}").id for one in range(JOBS - RENDERING)]


@pytest.fixture
def shown(visit: Visit, rendering: list[StagedJob], queued: list[str]) -> tuple[Page, Looks]:
    """All of them, at a time that stands still: no word of it changes by itself."""
    visitor = visit("/submit", expected={404})  # the staged jobs have no images
    page = visitor.page
    page.clock.set_fixed_time(datetime.now(timezone.utc) + timedelta(hours=1))
    looks = Looks(page)
    page.get_by_role("link", name="Jobs", exact=True).click()
    for expected in (50, 100, 150, 200):
        expect(page.locator(".job")).to_have_count(expected)
        if expected < JOBS:
            page.get_by_role("button", name="Older jobs").click()
    looks.wait(page, 1)
    return page, looks


@pytest.mark.long
def test_only_rows_that_change_are_touched(
    shown: tuple[Page, Looks], rendering: list[StagedJob]
) -> None:
    page, looks = shown
    page.evaluate(WATCH)
    # When nothing happens, nothing is touched, and each look asks for the same few pages
    looks.asked.clear()
    looks.wait(page, 4)
    assert page.evaluate("touched") == []
    assert not [one for one in looks.asked if not re.match(r"jobs\?|workers$", one)]
    assert len(looks.asked) <= 4 * (looks.count + 1)
    # When three of the ten go on, their rows change and no other
    going = rendering[:3]
    for one in going:
        one.commit(4)
        one.point(200, 2)
    for one in going:
        expect(row(page, one.id)).to_contain_text("200 spp")
    looks.wait(page, 3)
    assert set(page.evaluate("touched")) == {one.id for one in going}
    assert len(page.evaluate("touched")) < 20 * len(going)


@pytest.mark.long
def test_rows_far_down_are_not_forgotten(
    shown: tuple[Page, Looks],
    farm: NoiseFarm,
    client: redis.Redis,
    rendering: list[StagedJob],
    queued: list[str],
) -> None:
    page, _ = shown
    # One that renders no more says so with the next look
    ended = rendering[0]
    ended.end(JobState.EXHAUSTED)
    expect(row(page, ended.id)).to_contain_text("reached its cap")
    # One that waits, and is cancelled, when its page has its turn
    farm.jobs.cancel(queued[0])
    expect(row(page, queued[0])).to_contain_text("cancelled")
    # And one that is forgotten goes
    ended.finish(100)
    assert Scripts(client).run(Forget(job=ended.id, finished_for_ms=0)) == "forgotten"
    expect(row(page, ended.id)).to_have_count(0)
    expect(page.locator(".job")).to_have_count(JOBS - 1)
    # A new one comes on top
    new = farm.submit("new")
    expect(page.locator(".job").first).to_have_attribute("data-job", new.id)
    expect(page.locator(".job")).to_have_count(JOBS)
