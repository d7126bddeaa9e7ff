"""Anybody can use the page: by keyboard, by ear, on a phone, in the dark."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from plateau.farm.model.job import Job
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.long_tests import rare
from tests.support.processes.browser import violations
from tests.support.until import until

PHONE = {"width": 360, "height": 740}


@pytest.fixture
def job(farm: NoiseFarm) -> Job:
    """A job that renders, with a worker and a point, beside one of a batch."""
    job = farm.submit("box-with-a-name-that-is-longer-than-a-phone-is-wide-" * 2, step=25)
    with farm.monitor():
        farm.render(3)
        until(lambda: bool(farm.jobs.results(job.id)))
    farm.submit("other", batch="exposures")
    return job


def screens(page: Page, job: Job) -> Iterator[str]:
    """Each screen, opened and filled."""
    for path, place in (
        ("/", ".job"),
        ("/workers", ".nothing"),
        ("/submit", ".drop"),
        (f"/jobs/{job.id}", ".frame .layer"),
    ):
        page.goto(path)
        expect(page.locator(place).first).to_be_visible()
        for summary in page.locator("main details > summary:visible").all():
            if summary.evaluate("one => !one.parentElement.open"):
                summary.click()
        yield path


#: Only here the policy is off, for axe to be put in.
LOOKED_AT = {"bypass_csp": True, "reduced_motion": "reduce"}


@pytest.mark.parametrize("scheme", ["light", *rare("dark")])
def test_no_rule_of_accessibility_is_broken(visit: Visit, job: Job, scheme: str) -> None:
    page = visit(color_scheme=scheme, **LOOKED_AT).page
    for path in screens(page, job):
        assert violations(page) == [], path
    page.goto("/")
    page.get_by_role("checkbox", name="Select other").check()
    expect(page.get_by_role("region", name="Selected jobs")).to_be_visible()
    assert violations(page) == []
    page.get_by_role("button", name="Cancel…").click()
    expect(page.get_by_role("dialog")).to_be_visible()
    assert violations(page) == []


def test_nor_on_a_phone_which_needs_no_scrolling_sideways(visit: Visit, job: Job) -> None:
    page = visit(viewport=PHONE, has_touch=True, **LOOKED_AT).page
    for path in screens(page, job):
        assert violations(page) == [], path
        if path == "/":
            page.get_by_role("checkbox", name="Select other").check()
        widths = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert widths[0] <= widths[1], path


@pytest.mark.parametrize(
    "path",
    [
        "/jobs/0123456789ab",
        *rare(
            "/",
            "/workers",
            "/submit",
            "/studies",
            "/studies/0123456789ab",
            "/studies/0123456789ab/observe",
        ),
    ],
)
def test_nor_while_the_service_is_slow_to_answer(visit: Visit, path: str) -> None:
    page = visit(**LOOKED_AT).page
    page.route("**/v1/**", lambda route: None)  # which answers nothing
    with page.expect_request(re.compile("/v1/(jobs|workers|scenes|studies)")):
        page.goto(path)
    expect(page.get_by_role("heading", level=1)).to_have_count(1)
    assert violations(page) == []


def test_a_new_screen_is_told_to_who_listens_and_the_dark_is_dark(visit: Visit) -> None:
    page = visit().page
    backgrounds = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        backgrounds.append(page.evaluate("getComputedStyle(document.body).backgroundColor"))
    light, dark = (sum(map(int, one[4:-1].split(","))) for one in backgrounds)
    assert light > 700
    assert dark < 100
    page.get_by_role("link", name="Workers").click()
    expect(page.locator("main")).to_be_focused()
    assert page.title() == "Workers · Plateau"
    expect(page.get_by_role("link", name="Workers")).to_have_attribute("aria-current", "page")
    for role in ("banner", "main", "navigation"):
        expect(page.get_by_role(role)).to_have_count(1)
    page.go_back()
    expect(page.get_by_role("heading", name="Jobs")).to_be_visible()
