"""Asking for a job by the page, where the answer is lost: asked again, it is made once."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from plateau.farm.wire.examples import SCENE_XML
from tests.page.conftest import Visit
from tests.page.job.test_compare import finished
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.processes.browser import Visitor

NOT_KNOWN = "It is not known whether the request arrived; try again: nothing is made twice."
A_JOB = re.compile("/jobs/[0-9a-f]{12}$")


def lose_an_answer(page: Page, path: str, status: int = 0) -> None:
    """The API makes the change that it is asked for there next, and the answer is lost.

    Or, with a status, it is that of a proxy.
    """

    lost: list[str] = []

    def lose(route: Route) -> None:
        if lost or route.request.method == "GET":
            route.fallback()
            return
        lost.append(route.request.url)
        route.fetch()
        if status:
            route.fulfill(status=status, body="<h1>Bad gateway</h1>")
        else:
            route.abort("connectionreset")

    page.route(path, lose)


def ids(farm: NoiseFarm) -> list[str]:
    return [job.id for job in farm.jobs.search()[0]]


def leads_to(visitor: Visitor, made: str) -> None:
    """Assert that the page is soon at this job; that an answer was lost is the test's doing."""
    expect(visitor.page).to_have_url(re.compile(f"/jobs/{made}$"))
    visitor.forgive()


class TestASubmission:
    @pytest.fixture
    def visitor(self, visit: Visit, tmp_path: Path) -> Visitor:
        """Somebody who has filled in the form."""
        visitor = visit("/submit", expected={422, 502})
        scene = tmp_path / "sphere.xml"
        scene.write_text(SCENE_XML)
        visitor.page.set_input_files("#scene-file", scene)
        expect(visitor.page.locator(".found")).to_contain_text("256 × 256 pixels")
        return visitor

    @pytest.mark.parametrize("status", [0, 502])
    def test_is_sent_again_as_the_same(
        self, visitor: Visitor, farm: NoiseFarm, status: int
    ) -> None:
        page, wrong = visitor.page, visitor.page.locator(".wrong")
        lose_an_answer(page, "**/v1/jobs", status)
        page.get_by_role("button", name="Render it").click()
        expect(wrong).to_contain_text(NOT_KNOWN)
        # It did arrive. A change that is refused and taken back is no other request
        (made,) = ids(farm)
        page.get_by_text("More", exact=True).click()
        page.get_by_label("No sooner than").fill("20000")
        page.get_by_role("button", name="Render it").click()
        expect(wrong).to_contain_text("min_spp must not be above max_spp")
        page.get_by_label("No sooner than").fill("")
        # And then
        page.get_by_role("button", name="Render it").click()
        leads_to(visitor, made)
        assert ids(farm) == [made]

    def test_that_was_changed_says_that_the_first_has_arrived(
        self, visitor: Visitor, farm: NoiseFarm
    ) -> None:
        page, wrong = visitor.page, visitor.page.locator(".wrong")
        lose_an_answer(page, "**/v1/jobs")
        page.get_by_role("button", name="Render it").click()
        expect(wrong).to_contain_text(NOT_KNOWN)
        (first,) = ids(farm)
        # When something else is asked for
        page.get_by_label("At most").fill("2000")
        page.get_by_role("button", name="Render it").click()
        expect(wrong).to_contain_text(f"Your earlier request has arrived, as job {first}.")
        assert ids(farm) == [first]
        # Then it is made where that is wanted, too
        page.get_by_role("button", name="Render it").click()
        expect(page).to_have_url(A_JOB)
        leads_to(visitor, page.url.rpartition("/")[2])
        assert len(ids(farm)) == 2


@pytest.mark.parametrize(
    ("opens", "starts", "path"),
    [("Continue…", "Continue", "continue"), ("Judge again…", "Judge it", "rejudge")],
)
def test_a_job_that_goes_on_is_made_once(
    visit: Visit, farm: NoiseFarm, opens: str, starts: str, path: str
) -> None:
    job = finished(farm, keep_slices=True)
    visitor = visit(f"/jobs/{job.id}", expected={404})
    page = visitor.page
    page.get_by_role("button", name=opens).click()
    lose_an_answer(page, f"**/v1/jobs/*/{path}")
    page.get_by_role("button", name=starts, exact=True).click()
    expect(page.get_by_role("dialog")).to_contain_text(NOT_KNOWN)
    (made,) = set(ids(farm)) - {job.id}
    page.get_by_role("button", name=starts, exact=True).click()
    leads_to(visitor, made)
    assert len(ids(farm)) == 2


def test_another_change_says_that_nobody_knows(visit: Visit, farm: NoiseFarm) -> None:
    job = farm.submit("box")
    visitor = visit(f"/jobs/{job.id}")
    page = visitor.page
    lose_an_answer(page, f"**/v1/jobs/{job.id}")
    page.get_by_label("Priority").fill("7")
    page.get_by_role("button", name="Set").click()
    expect(page.get_by_text("it is not known whether this arrived. Try again.")).to_be_visible()
    visitor.forgive()
