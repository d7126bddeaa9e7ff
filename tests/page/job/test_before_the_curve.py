"""A job's screen before its first point: its image is there by then, and is what is spoken of."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from plateau.farm.ledger.queue import Lease
from plateau.farm.model.job import Job
from tests.page.conftest import Visit
from tests.page.job.conftest import is_shown, png
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until

#: Four slices to the first point.
SPEC = {"step": 100, "slice_spp": 25, "max_spp": 1000}


@pytest.fixture
def job(farm: NoiseFarm) -> Iterator[Job]:
    with farm.monitor():
        yield farm.submit("box", **SPEC)


def shows(farm: NoiseFarm, job: Job, spp: int) -> None:
    until(lambda: farm.jobs.get(job.id).image_spp == spp)


def cancelled(farm: NoiseFarm, job: Job) -> None:
    farm.jobs.cancel(job.id)
    until(lambda: farm.jobs.get(job.id).finished_at is not None)


def files_are(page: Page, *names: str) -> None:
    expect(page.locator(".files a")).to_have_text(list(names))


def test_files_are_listed_as_they_come(visit: Visit, farm: NoiseFarm, job: Job) -> None:
    page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".files")).to_have_text("They come with its first samples.")
    # Given an image and no point
    farm.render(2)
    files_are(page, "EXR", "PNG", "Zip")
    with page.expect_download() as download:
        page.locator(".files").get_by_role("link", name="EXR").click()
    assert download.value.path().read_bytes().startswith(b"v/1\x01")
    # When there is a point
    farm.render(2)
    files_are(page, "EXR", "PNG", "Difference", "Noise", "CSV", "Zip")


def test_a_job_that_ended_without_an_image_says_so(visit: Visit, farm: NoiseFarm, job: Job) -> None:
    page = visit(f"/jobs/{job.id}").page
    nothing, files = page.locator(".nothing-yet"), page.locator(".files")
    expect(nothing).to_have_text("Its first image comes with its first samples.")
    cancelled(farm, job)
    for _ in range(2):  # to who has seen it end, and to who comes later
        expect(nothing).to_have_text("The job ended without an image.")
        expect(files).to_have_text("It ended without any.")
        page.reload()


def test_a_job_without_pictures_says_so(visit: Visit, farm: NoiseFarm, job: Job) -> None:
    cancelled(farm, job)
    bare = farm.submit("box", **SPEC, pictures=False)
    page = visit(f"/jobs/{bare.id}").page
    said = "The job makes no pictures; at its end, image.exr has its image."
    expect(page.locator(".nothing-yet")).to_have_text(said)
    farm.render(2)
    cancelled(farm, bare)
    files_are(page, "EXR", "Zip")
    expect(page.locator(".nothing-yet")).to_have_text(said)
    expect(page.get_by_role("button", name="Compare")).to_be_hidden()


class TestDifference:
    @pytest.fixture
    def lease(self, farm: NoiseFarm, job: Job) -> Lease:
        """The first slice, of which the first pass is shown."""
        lease = farm.next_lease()
        farm.glimpse(lease, 4)
        shows(farm, job, 4)
        return lease

    def test_leaves_nothing_of_a_comparison_over_the_image(
        self, visit: Visit, farm: NoiseFarm, job: Job, lease: Lease
    ) -> None:
        page = visit(f"/jobs/{job.id}", expected={404}).page
        below, above = (page.locator(".side").nth(number) for number in (0, 1))
        page.get_by_role("button", name="Compare").click()
        expect(above).to_be_visible()
        # When there is no difference to be seen yet
        page.get_by_role("button", name="Difference", exact=True).click()
        expect(above).to_be_hidden()
        farm.commit(lease)
        expect(page.locator(".caption")).to_contain_text("25 spp")
        is_shown(below.locator("img"), png(farm.picture(job, "image.png")))
        expect(above).to_be_hidden()
        # Until there is one
        farm.render(3)
        expect(above).to_be_visible()
        is_shown(above.locator("img"), png(farm.picture(job, "difference.png")))
        is_shown(below.locator("img"), png(farm.picture(job, "image.png")))
