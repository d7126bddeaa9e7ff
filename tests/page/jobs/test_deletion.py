"""Ended jobs are deleted and restored, and views of the list saved, in a real browser."""

import re

import pytest
from playwright.sync_api import Locator, Page, expect

from plateau.farm.ledger.deletions import Deletions
from plateau.farm.model.job import Job
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm


@pytest.fixture
def jobs(farm: NoiseFarm) -> dict[str, Job]:
    """Three jobs that have ended, one of them in a batch, and one that waits."""
    specs = {"one": {}, "two": {}, "frame": {"batch": "walk"}}
    made = {name: farm.jobs.cancel(farm.submit(name, **spec).id) for name, spec in specs.items()}
    return {**made, "waits": farm.submit("waits")}


def names(page: Page) -> Locator:
    return page.locator(".job .name")


def choose(page: Page, menu: str, action: str) -> None:
    page.get_by_role("button", name=f"Actions for {menu}").click()
    page.get_by_role("button", name=action, exact=True).click()


def done(page: Page) -> Locator:
    return page.get_by_role("region", name="Done")


def test_many_go_at_once_and_come_back(visit: Visit, farm: NoiseFarm, jobs: dict[str, Job]) -> None:
    page = visit().page
    bar = page.get_by_role("region", name="Selected jobs")
    for name in ("one", "frame", "waits"):
        page.get_by_role("checkbox", name=f"Select {name}").check()
    expect(bar.get_by_role("button", name="Restore")).to_be_hidden()
    bar.get_by_role("button", name="Delete").click()
    # What has not ended stays
    expect(done(page)).to_contain_text("2 jobs are deleted.")
    expect(names(page)).to_have_text(["waits", "two"])
    expect(bar).to_contain_text("1 job selected")
    page.get_by_role("combobox", name="Show").select_option("deleted")
    expect(page).to_have_url(re.compile(r"\?show=deleted$"))
    expect(names(page)).to_have_text(["frame", "one"])
    expect(page.locator(".job").first).to_contain_text("deleted just now")
    page.get_by_role("checkbox", name="Select one").check()
    expect(bar.get_by_role("button", name="Delete")).to_be_hidden()
    bar.get_by_role("button", name="Restore").click()
    expect(names(page)).to_have_text(["frame"])
    # An undo puts a job where it was
    done(page).get_by_role("button", name="Undo").click()
    expect(names(page)).to_have_text(["frame", "one"])
    page.get_by_role("checkbox", name="Select one").check()
    bar.get_by_role("button", name="Restore").click()
    expect(names(page)).to_have_text(["frame"])
    page.goto("/")
    expect(names(page)).to_have_text(["waits", "two", "one"])


def test_the_undo_of_a_batch_leaves_what_was_deleted_before(
    visit: Visit, farm: NoiseFarm, jobs: dict[str, Job]
) -> None:
    before, other = (farm.jobs.cancel(farm.submit(batch="walk").id) for _ in range(2))
    Deletions(farm.jobs._redis).set(before.id, deleted=True)
    page = visit().page
    choose(page, "the batch walk", "Delete")
    expect(done(page)).to_contain_text("2 jobs of walk are deleted.")
    done(page).get_by_role("button", name="Undo").click()
    expect(page.get_by_role("status").filter(has_text="jobs of walk are put back")).to_have_count(1)
    put_back = [farm.jobs.get(job.id).deleted_at for job in (other, jobs["frame"])]
    assert put_back == [None, None]
    assert farm.jobs.get(before.id).deleted_at is not None
    # A batch is restored as one, too
    page.get_by_role("combobox", name="Show").select_option("deleted")
    expect(page.locator(".job")).to_have_count(1)
    choose(page, "the batch walk", "Restore")
    expect(page.get_by_text("No job matches.")).to_be_visible()
    assert farm.jobs.get(before.id).deleted_at is None


def test_the_screen_of_a_job_says_so_and_restores_it(
    visit: Visit, farm: NoiseFarm, jobs: dict[str, Job]
) -> None:
    # One that is deleted in the list is gone at once, and an undo brings it back
    page = visit().page
    choose(page, "one", "Delete")
    expect(done(page)).to_contain_text("one is deleted.")
    expect(names(page)).to_have_text(["waits", "frame", "two"])
    assert farm.jobs.get(jobs["one"].id).deleted_at is not None
    done(page).get_by_role("button", name="Undo").press("Enter")
    expect(names(page)).to_have_text(["waits", "frame", "two", "one"])
    assert farm.jobs.get(jobs["one"].id).deleted_at is None
    page.goto(f"/jobs/{jobs['two'].id}")
    actions = page.get_by_role("group", name="Actions")
    actions.get_by_role("button", name="Delete").click()
    expect(page.locator(".one-job .summary").first).to_contain_text("deleted just now")
    # The undo stays on the way to the list
    page.get_by_role("link", name="Jobs", exact=True).first.click()
    expect(names(page)).to_have_text(["waits", "frame", "one"])
    done(page).get_by_role("button", name="Undo").click()
    expect(done(page)).to_be_hidden()
    expect(names(page)).to_have_text(["waits", "frame", "two", "one"])
    Deletions(farm.jobs._redis).set(jobs["two"].id, deleted=True)
    page.goto(f"/jobs/{jobs['two'].id}")
    actions.get_by_role("button", name="Restore").click()
    expect(actions.get_by_role("button", name="Delete")).to_be_visible()


def test_what_others_did_meanwhile_is_said(
    visit: Visit, farm: NoiseFarm, jobs: dict[str, Job]
) -> None:
    visitor = visit(expected={404})
    page = visitor.page
    page.get_by_role("checkbox").first.wait_for()
    page.route("**/v1/jobs?*", lambda route: None)  # the page does not see what follows
    # A batch whose only job was deleted is no more
    Deletions(farm.jobs._redis).set(jobs["frame"].id, deleted=True)
    choose(page, "the batch walk", "Delete")
    expect(page.get_by_role("alert")).to_contain_text("there is no batch")
    farm.jobs._redis.delete(f"plateau:job:{jobs['one'].id}")
    choose(page, "one", "Delete")
    expect(page.get_by_role("alert")).to_contain_text("Refused for 1 of 1 job. one: there is no")
