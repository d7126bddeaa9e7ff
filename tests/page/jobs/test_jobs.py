"""The list of jobs, in a real browser."""

import re

from playwright.sync_api import Locator, Page, Request, expect

from plateau.farm.model.states import JobState
from plateau.farm.redis.commands.sweeps import Forget
from plateau.farm.redis.scripts import Scripts
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until

QUICK = {"step": 50, "max_spp": 200, "rule": {"name": "fixed", "spp": 200}}


def row(page: Page, job_id: str) -> Locator:
    return page.locator(f'[data-job="{job_id}"]')


def test_an_empty_farm_says_what_to_do(page: Page) -> None:
    expect(page.get_by_role("heading", name="Jobs")).to_be_visible()
    expect(page.get_by_text("Nothing to see yet.")).to_be_visible()
    page.locator("main").get_by_role("link", name="Submit a scene").click()
    expect(page).to_have_url(re.compile("/submit$"))
    expect(page.get_by_role("heading", name="Submit a scene")).to_be_visible()


def test_a_job_is_followed_from_its_queue_to_its_end(visit: Visit, farm: NoiseFarm) -> None:
    visitor = visit(expected={404})  # its first picture comes a moment after its first point
    page = visitor.page
    job = farm.submit("box", **QUICK)
    # A new job comes by itself, and its row stays the same element while it changes
    shown = row(page, job.id)
    expect(shown).to_contain_text("queued")
    shown.evaluate("element => { element.theSame = true; }")
    with farm.monitor():
        farm.render(4)
        expect(shown).to_contain_text("100 spp")
        expect(shown).to_contain_text("of 200 at most")
        farm.render(4)
        expect(shown).to_contain_text("converged")
        expect(shown).to_contain_text("200 spp")
        expect(shown.locator("img")).to_have_js_property("naturalWidth", 32)
    assert shown.evaluate("element => element.theSame")
    shown.get_by_role("link", name="box").click()
    expect(page).to_have_url(re.compile(f"/jobs/{job.id}$"))
    page.go_back()
    expect(row(page, job.id)).to_be_visible()


def test_a_queued_job_says_its_place(visit: Visit, farm: NoiseFarm) -> None:
    first, second = (farm.submit("box") for _ in range(2))
    page = visit().page
    expect(row(page, first.id)).to_contain_text("place 1 in the queue")
    expect(row(page, second.id)).to_contain_text("place 2 in the queue")
    page.goto(f"/jobs/{second.id}")
    expect(page.locator(".summary").first).to_contain_text("place 2 in the queue")


def test_rows_of_one_scene_are_told_apart(visit: Visit, farm: NoiseFarm) -> None:
    bright = farm.submit("box", parameters={"intensity": 40}, rule={"name": "fixed", "spp": 100})
    zones = farm.submit("box", allocation={"name": "zones"})
    size = {"width": 32, "height": "24", "depth": 3}
    sized = farm.submit("box", parameters=size, priority=1, pictures=False)
    with farm.monitor():  # the size of an image is known from its first slice on
        farm.work(lambda: farm.jobs.get(sized.id).width)
    visitor = visit()
    expect(row(visitor.page, bright.id)).to_contain_text("intensity 40 · rule fixed")
    expect(row(visitor.page, zones.id)).to_contain_text("by zones")
    # The size of an image is said once
    expect(row(visitor.page, sized.id).locator(".asked")).to_have_text(
        "32 × 24 · depth 3 · rule visible"
    )


def test_the_jobs_of_a_batch_are_together(page: Page, farm: NoiseFarm) -> None:
    for intensity in (10, 40):
        farm.submit("lamp", batch="exposures", parameters={"intensity": intensity, "n": 1})
    alone = farm.submit("alone")
    page.reload()
    batch = page.locator('[data-batch="exposures"]')
    expect(batch).to_contain_text("2 jobs: 2 queued")
    # Where some may be left out, it says so
    page.goto("/?state=queued")
    expect(batch).to_contain_text("2 jobs listed: 2 queued")
    page.goto("/")
    # What tells them apart is said, and only that
    expect(batch.get_by_role("link", name="lamp, intensity 40", exact=True)).to_be_visible()
    expect(batch.get_by_role("link", name="lamp, intensity 10", exact=True)).to_be_visible()
    # And all of them are cancelled at once
    every = batch.get_by_role("checkbox", name="Select all of the batch exposures")
    every.check()
    page.get_by_role("checkbox", name="Select lamp, intensity 10").uncheck()
    expect(every).to_have_js_property("indeterminate", True)
    every.check()
    page.get_by_role("button", name="Cancel…").click()
    page.get_by_role("button", name="Cancel 2 jobs").click()
    expect(batch).to_contain_text("2 jobs: 2 cancelled")
    assert farm.jobs.get(alone.id).state is JobState.QUEUED


#: The page asks seldom where an answer takes long: on a busy machine, each half a minute.
MINUTES_MS = 180_000


def test_more_jobs_than_the_api_sends_at_once_fetch_only_what_is_in_sight(
    visit: Visit, farm: NoiseFarm
) -> None:
    done = farm.submit("first", **QUICK)
    with farm.monitor():
        farm.render(8)
        until(lambda: farm.is_finished(done))
    queued = [farm.submit(f"job-{number}") for number in range(249)]
    visitor = visit("/submit", expected={404})
    asked: list[str] = []

    def note(request: Request) -> None:
        asked.append(request.url)

    visitor.page.on("request", note)
    visitor.page.get_by_role("link", name="Jobs", exact=True).click()
    rows = visitor.page.locator(".job")
    expect(rows).to_have_count(50)
    for expected in (100, 150, 200, 250):
        visitor.page.get_by_role("button", name="Older jobs").click()
        expect(rows).to_have_count(expected)
    # The finished job is far below: nobody has asked for its picture
    assert not [url for url in asked if done.id in url]
    row(visitor.page, done.id).scroll_into_view_if_needed()
    expect(row(visitor.page, done.id).locator("img")).to_be_visible()
    # And rows far down are not forgotten: one is cancelled, and one goes when its job is forgotten
    farm.jobs.cancel(queued[0].id)
    assert Scripts(farm.client).run(Forget(job=done.id, finished_for_ms=0)) == "forgotten"
    new = farm.submit("new")
    expect(row(visitor.page, queued[0].id)).to_contain_text("cancelled", timeout=MINUTES_MS)
    expect(row(visitor.page, done.id)).to_have_count(0, timeout=MINUTES_MS)
    # A new one comes on top
    expect(rows.first).to_have_attribute("data-job", new.id, timeout=MINUTES_MS)
    expect(rows).to_have_count(250)
