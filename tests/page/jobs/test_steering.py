"""Ended jobs are deleted and restored, in a real browser."""

import re

from playwright.sync_api import Page, expect

from plateau.farm.model.states import JobState
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm


def names(page: Page, *wanted: str) -> None:
    expect(page.locator(".job .name")).to_have_text(list(wanted))


def test_many_go_at_once_and_come_back(visit: Visit, farm: NoiseFarm) -> None:
    for name in ("one", "two", "frame"):
        farm.jobs.cancel(farm.submit(name).id)
    farm.submit("waits")
    page = visit().page
    bar = page.get_by_role("region", name="Selected jobs")
    for name in ("one", "frame", "waits"):
        page.get_by_role("checkbox", name=f"Select {name}").check()
    expect(bar.get_by_role("button", name="Restore")).to_be_hidden()
    bar.get_by_role("button", name="Delete…").click()
    page.get_by_role("button", name="Delete 2 jobs").click()
    # What has not ended stays
    names(page, "waits", "two")
    expect(bar).to_contain_text("1 job selected")
    page.get_by_role("combobox", name="Show").select_option("deleted")
    expect(page).to_have_url(re.compile(r"\?show=deleted$"))
    names(page, "frame", "one")
    expect(page.locator(".job").first).to_contain_text(re.compile("deleted (just now|. min ago)"))
    page.get_by_role("checkbox", name="Select one").check()
    expect(bar.get_by_role("button", name="Delete")).to_be_hidden()
    bar.get_by_role("button", name="Restore").click()
    names(page, "frame")
    page.goto("/")
    names(page, "waits", "two", "one")


def test_none_goes_that_was_not_asked_about(visit: Visit, farm: NoiseFarm) -> None:
    farm.jobs.cancel(farm.submit("one").id)
    waits = farm.submit("waits")
    page = visit().page
    for name in ("one", "waits"):
        page.get_by_role("checkbox", name=f"Select {name}").check()
    page.get_by_role("button", name="Delete…").click()
    expect(page.get_by_role("dialog")).to_contain_text("Delete one?")
    # When another ends before the answer
    farm.jobs.cancel(waits.id)
    expect(page.locator(".job", has_text="waits")).to_contain_text("cancelled")
    page.get_by_role("button", name="Delete the job").click()
    names(page, "waits")


def test_all_go_that_were_asked_about(visit: Visit, farm: NoiseFarm) -> None:
    jobs = [farm.submit(name) for name in ("one", "two")]
    page = visit("/?state=queued").page
    for name in ("one", "two"):
        page.get_by_role("checkbox", name=f"Select {name}").check()
    page.get_by_role("button", name="Cancel…").click()
    # When one leaves the list before the answer
    with farm.monitor():
        assert farm.next_lease().job_id == jobs[0].id
    names(page, "two")
    page.get_by_role("button", name="Cancel 2 jobs").click()
    names(page)
    assert {farm.jobs.get(job.id).state for job in jobs} == {JobState.CANCELLED}


def test_the_screen_of_a_job_steers_deletes_and_restores_it(visit: Visit, farm: NoiseFarm) -> None:
    job = farm.submit("box")
    with farm.monitor():
        farm.render(1)
    page = visit(f"/jobs/{job.id}", expected={404}).page
    actions = page.get_by_role("group", name="Actions")
    state = page.locator(".title .state")
    actions.get_by_role("button", name="Pause").click()
    expect(state).to_have_text("paused")
    actions.get_by_role("button", name="Resume").click()
    expect(state).to_have_text("rendering")
    # By keyboard alone
    page.get_by_label("Priority").focus()
    page.keyboard.press("Control+A")
    page.keyboard.type("7")
    page.keyboard.press("Enter")
    expect(page.get_by_role("status").filter(has_text="box is given priority 7")).to_have_count(1)
    assert farm.jobs.get(job.id).spec.priority == 7
    # What cannot be taken back is asked for twice, and not on another screen
    page.get_by_role("link", name="Workers").click()
    page.go_back()
    actions.get_by_role("button", name="Cancel…").click()
    page.go_forward()
    expect(page.get_by_role("heading", name="Workers")).to_be_visible()
    expect(page.get_by_role("dialog")).to_have_count(0)
    page.go_back()
    actions.get_by_role("button", name="Cancel…").click()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(state).to_have_text("rendering")
    actions.get_by_role("button", name="Cancel…").click()
    page.get_by_role("button", name="Cancel the job").click()
    expect(state).to_have_text("cancelled")
    actions.get_by_role("button", name="Delete…").click()
    page.get_by_role("button", name="Delete the job").click()
    expect(page.locator(".one-job .summary").first).to_contain_text("deleted just now")
    actions.get_by_role("button", name="Restore").click()
    expect(actions.get_by_role("button", name="Delete…")).to_be_visible()
