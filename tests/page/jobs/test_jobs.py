"""The list of jobs, in a real browser."""

import re

import pytest
from playwright.sync_api import Locator, Page, Request, expect
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.model.states import JobState
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
        expect(shown.locator("svg .line")).to_have_attribute("d", re.compile("^M"))
        farm.render(4)
        expect(shown).to_contain_text("converged")
        expect(shown).to_contain_text("200 spp")
        expect(shown.locator("img")).to_have_js_property("naturalWidth", 32)
    assert shown.evaluate("element => element.theSame")
    shown.get_by_role("link", name="box").click()
    expect(page).to_have_url(re.compile(f"/jobs/{job.id}$"))
    page.go_back()
    expect(row(page, job.id)).to_be_visible()


def test_a_queued_job_says_its_place(
    visit: Visit, farm: NoiseFarm, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLATEAU_URL", url)
    first, second = (farm.submit("box") for _ in range(2))
    page = visit().page
    expect(row(page, first.id)).to_contain_text("place 1 in the queue")
    words = "place 2 in the queue"
    expect(row(page, second.id)).to_contain_text(words)
    page.goto(f"/jobs/{second.id}")
    expect(page.locator(".summary").first).to_contain_text(words)
    assert words in CliRunner().invoke(app, ["show", second.id]).stdout
    listed = CliRunner().invoke(app, ["list"]).stdout.splitlines()
    assert [line.split("\t")[5] for line in listed] == [words, "place 1 in the queue"]


def test_rows_of_one_scene_are_told_apart(visit: Visit, farm: NoiseFarm) -> None:
    bright = farm.submit("box", parameters={"intensity": 40}, rule={"name": "fixed", "spp": 100})
    zones = farm.submit("box", allocation={"name": "zones"})
    sized = farm.submit("box", parameters={"width": 32, "height": "24", "depth": 3}, priority=1)
    with farm.monitor():  # the size of an image is known from its first slice on
        farm.work(lambda: farm.jobs.get(sized.id).width)
    visitor = visit()
    expect(row(visitor.page, bright.id)).to_contain_text("intensity 40 · rule fixed")
    expect(row(visitor.page, zones.id)).to_contain_text("by zones")
    # The size of an image is said once
    expect(row(visitor.page, sized.id).locator(".asked")).to_have_text("32 × 24 · depth 3")
    # A click on an id copies it, and does not lead to the job
    visitor.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visitor.page.get_by_role("button", name=f"Copy the job's id, {zones.id}").click()
    said = visitor.page.get_by_role("status").filter(has_text=f"The job's id {zones.id} is copied")
    expect(said).to_have_count(1)
    assert visitor.page.evaluate("navigator.clipboard.readText()") == zones.id
    expect(visitor.page).to_have_url(re.compile("/$"))


def test_a_path_without_a_screen_says_so(visit: Visit) -> None:
    page = visit("/job/box", expected={404}).page
    expect(page.get_by_role("heading", name="There is nothing here")).to_be_visible()
    expect(page.get_by_text("No page of this farm is at /job/box.")).to_be_visible()
    page.get_by_role("link", name="Show the jobs").click()
    expect(page.get_by_role("heading", name="Jobs", exact=True)).to_be_visible()


def test_filters_are_part_of_the_address(page: Page, farm: NoiseFarm) -> None:
    kept, other = farm.submit("kept"), farm.submit("other", batch="evening")
    farm.jobs.cancel(other.id)
    page.reload()
    expect(row(page, kept.id)).to_be_visible()
    page.get_by_role("combobox", name="State").select_option("cancelled")
    expect(page).to_have_url(re.compile(r"\?state=cancelled$"))
    expect(row(page, other.id)).to_be_visible()
    expect(row(page, kept.id)).to_have_count(0)
    page.reload()
    expect(page.get_by_role("combobox", name="State")).to_have_value("cancelled")
    page.get_by_role("combobox", name="State").select_option("")
    page.get_by_role("combobox", name="Batch").select_option("evening")
    expect(page).to_have_url(re.compile(r"\?batch=evening$"))
    expect(row(page, kept.id)).to_have_count(0)
    expect(row(page, other.id)).to_be_visible()


def test_the_jobs_of_a_batch_are_together(page: Page, farm: NoiseFarm) -> None:
    for intensity in (10, 40):
        farm.submit("lamp", batch="exposures", parameters={"intensity": intensity, "n": 1})
    alone = farm.submit("alone")
    page.reload()
    batch = page.locator('[data-batch="exposures"]')
    expect(batch).to_contain_text("2 jobs: 2 queued")
    # What tells them apart is said, and only that
    expect(batch.get_by_role("link", name="lamp, intensity 40", exact=True)).to_be_visible()
    expect(batch.get_by_role("link", name="lamp, intensity 10", exact=True)).to_be_visible()
    # And all of them are cancelled at once
    batch.get_by_role("button", name="Actions for the batch exposures").click()
    batch.get_by_role("button", name="Cancel all").click()
    page.get_by_role("button", name="Cancel them all").click()
    expect(batch).to_contain_text("2 jobs: 2 cancelled")
    assert farm.jobs.get(alone.id).state is JobState.QUEUED


class TestWhatCanBeDone:
    @pytest.fixture
    def job_id(self, page: Page, farm: NoiseFarm) -> str:
        job = farm.submit("box")
        with farm.monitor():
            farm.render(1)
        assert farm.jobs.get(job.id).state is JobState.RENDERING
        page.reload()
        return job.id

    def test_pause_and_resume(self, page: Page, farm: NoiseFarm, job_id: str) -> None:
        row(page, job_id).get_by_role("button", name="Actions for box").click()
        page.get_by_role("button", name="Pause").click()
        expect(row(page, job_id)).to_contain_text("paused")
        assert farm.jobs.get(job_id).state is JobState.PAUSED
        row(page, job_id).get_by_role("button", name="Actions for box").click()
        page.get_by_role("button", name="Resume").click()
        expect(row(page, job_id).locator(".state")).to_have_text("rendering")

    def test_a_priority_by_keyboard_alone(self, page: Page, farm: NoiseFarm, job_id: str) -> None:
        row(page, job_id).get_by_role("button", name="Actions for box").focus()
        page.keyboard.press("Enter")
        page.get_by_label("Priority").focus()
        page.keyboard.press("Control+A")
        page.keyboard.type("7")
        page.keyboard.press("Enter")
        expect(page.get_by_role("status").filter(has_text="box has priority 7")).to_have_count(1)
        assert farm.jobs.get(job_id).spec.priority == 7

    def test_cancel_asks_first(self, page: Page, farm: NoiseFarm, job_id: str) -> None:
        def ask() -> None:
            row(page, job_id).get_by_role("button", name="Actions for box").click()
            page.get_by_role("button", name="Cancel", exact=True).click()

        ask()
        page.keyboard.press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)
        assert farm.jobs.get(job_id).state is JobState.RENDERING
        ask()
        page.get_by_role("button", name="Cancel the job").click()
        expect(row(page, job_id)).to_contain_text("cancelled")
        assert farm.jobs.get(job_id).state is JobState.CANCELLED

    @pytest.mark.long
    def test_what_the_service_refuses_is_shown_in_its_words(
        self, visit: Visit, farm: NoiseFarm, job_id: str
    ) -> None:
        visitor = visit(expected={409})
        row(visitor.page, job_id).get_by_role("button", name="Actions for box").click()
        farm.jobs.cancel(job_id)
        visitor.page.get_by_role("button", name="Pause").click()
        alert = visitor.page.get_by_role("alert")
        expect(alert).to_contain_text("only a job that is rendering")
        # And there is time to read it, though the next looks go well
        for _ in range(2):
            visitor.page.wait_for_event("response", lambda answer: "/v1/jobs?" in answer.url)
        expect(alert).to_contain_text("only a job that is rendering")


def test_two_hundred_jobs_fetch_only_what_is_in_sight(visit: Visit, farm: NoiseFarm) -> None:
    done = farm.submit("first", **QUICK)
    with farm.monitor():
        farm.render(8)
        until(lambda: farm.is_finished(done))
    for number in range(199):
        farm.submit(f"job-{number}")
    visitor = visit("/submit")
    asked: list[str] = []

    def note(request: Request) -> None:
        asked.append(request.url)

    visitor.page.on("request", note)
    visitor.page.get_by_role("link", name="Jobs", exact=True).click()
    rows = visitor.page.locator(".job")
    expect(rows).to_have_count(50)
    for expected in (100, 150, 200):
        visitor.page.get_by_role("button", name="Older jobs").click()
        expect(rows).to_have_count(expected)
    # The finished job is far below: nobody has asked for its picture or its curve
    assert not [url for url in asked if done.id in url]
    row(visitor.page, done.id).scroll_into_view_if_needed()
    expect(row(visitor.page, done.id).locator("img")).to_be_visible()
    # Long lists are shown again within a frame or two
    spent = visitor.page.evaluate(
        """async () => {
          const list = document.querySelector(".jobs");
          const before = performance.now();
          scrollTo(0, 0);
          await new Promise(requestAnimationFrame);
          await new Promise(requestAnimationFrame);
          return performance.now() - before;
        }"""
    )
    assert spent < 1000
