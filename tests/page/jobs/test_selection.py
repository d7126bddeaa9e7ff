"""Several jobs at once, in a real browser."""

from zipfile import ZipFile

import pytest
from playwright.sync_api import Page, expect

from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until


@pytest.fixture
def jobs(farm: NoiseFarm) -> list[Job]:
    """Four jobs, the newest first, of which the oldest renders."""
    rendering = farm.submit("one")
    with farm.monitor():
        farm.render(1)
    return [*reversed([farm.submit(name) for name in ("two", "three", "four")]), rendering]


def pick(page: Page, name: str) -> None:
    page.get_by_role("checkbox", name=f"Select {name}", exact=True).check()


def states(farm: NoiseFarm, jobs: list[Job]) -> list[JobState]:
    return [farm.jobs.get(job.id).state for job in jobs]


def test_a_priority_for_some_and_a_pause_for_those_that_render(
    visit: Visit, farm: NoiseFarm, jobs: list[Job]
) -> None:
    page = visit().page
    bar = page.get_by_role("region", name="Selected jobs")
    pick(page, "four")
    expect(bar).to_contain_text("1 job selected")
    expect(bar.get_by_role("button", name="Pause")).to_be_hidden()
    # With Shift, a click selects all that lie between
    page.get_by_role("checkbox", name="Select two").click(modifiers=["Shift"])
    expect(bar).to_contain_text("3 jobs selected")
    bar.get_by_label("Priority").fill("7")
    bar.get_by_role("button", name="Set").click()
    expect(page.get_by_role("status").filter(has_text="3 jobs are given priority 7")).to_have_count(
        1
    )
    assert [farm.jobs.get(job.id).spec.priority for job in jobs] == [7, 7, 7, 0]
    bar.get_by_role("button", name="Select all 4").click()
    bar.get_by_role("button", name="Pause").click()
    expect(page.get_by_role("status").filter(has_text="one is paused")).to_have_count(1)
    bar.get_by_role("button", name="Resume").click()
    expect(page.get_by_role("status").filter(has_text="one is resumed")).to_have_count(1)
    assert states(farm, jobs) == [JobState.QUEUED] * 3 + [JobState.RENDERING]
    bar.get_by_role("button", name="Clear").click()
    expect(bar).to_be_hidden()
    expect(page.get_by_role("checkbox", checked=True)).to_have_count(0)


def test_some_are_cancelled_by_keyboard_alone(
    visit: Visit, farm: NoiseFarm, jobs: list[Job]
) -> None:
    page = visit().page
    for name in ("two", "four"):
        page.get_by_role("checkbox", name=f"Select {name}").focus()
        page.keyboard.press("Space")
    page.get_by_role("button", name="Cancel…").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Cancel 2 jobs").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("status").filter(has_text="2 jobs are cancelled")).to_have_count(1)
    assert states(farm, jobs) == [
        JobState.CANCELLED,
        JobState.QUEUED,
        JobState.CANCELLED,
        JobState.RENDERING,
    ]
    # They stay selected, and what can be done with them is what can be done with ended jobs
    bar = page.get_by_role("region", name="Selected jobs")
    expect(bar).to_contain_text("2 jobs selected")
    expect(bar.get_by_role("button", name="Cancel…")).to_be_hidden()
    expect(bar.get_by_label("Priority")).to_be_hidden()
    bar.get_by_role("button", name="Delete…").press("Enter")
    page.get_by_role("button", name="Delete 2 jobs").press("Enter")
    # The bar goes with its last job
    expect(bar).to_have_count(0)
    expect(page.locator("main")).to_be_focused()
    expect(page.locator(".job")).to_have_count(2)


def test_their_results_come_in_one_zip(visit: Visit, farm: NoiseFarm, jobs: list[Job]) -> None:
    with farm.monitor():
        until(lambda: farm.jobs.results(jobs[3].id))
    page = visit().page
    bar = page.get_by_role("region", name="Selected jobs")
    pick(page, "two")
    # Of a job without an image there is nothing to fetch
    expect(bar.get_by_role("link", name="Download")).to_be_hidden()
    pick(page, "one")
    with page.expect_download() as download:
        bar.get_by_role("link", name="Download 1").click()
    assert download.value.suggested_filename == "results.zip"
    names = ZipFile(download.value.path()).namelist()
    assert f"0000-{jobs[3].id}/image.png" in names
    # Jobs that a search hides are selected no more, nor when they are listed again
    search = page.get_by_role("searchbox", name="Search the jobs")
    expect(bar).to_contain_text("2 jobs selected")
    for text, listed in (("two", 1), ("", 4)):
        search.fill(text)
        expect(page.locator(".job")).to_have_count(listed)
        expect(bar).to_contain_text("1 job selected")


def test_what_some_refuse_is_said(visit: Visit, farm: NoiseFarm, jobs: list[Job]) -> None:
    visitor = visit(expected={409})
    page = visitor.page
    # The page does not see that one of them has ended meanwhile
    page.get_by_role("checkbox").first.wait_for()
    page.route("**/v1/jobs?*", lambda route: None)
    with page.expect_request("**/v1/jobs?*"):  # those before it were answered
        pick(page, "one")
    pick(page, "two")
    farm.jobs.cancel(jobs[3].id)
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_role("alert")).to_contain_text("Refused for 1 of 1 job. one: ")
