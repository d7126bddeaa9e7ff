"""Any two images of a job's way side by side, at one exposure."""

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from plateau.farm.images.exr import Pixels, decode_partial
from plateau.farm.model.job import Job
from plateau.metric import encode_srgb
from plateau.picture.merge import Merge
from plateau.picture.previews import kept
from tests.page.conftest import Visit
from tests.page.job.test_job import SPEC, is_shown
from tests.page.test_access import violations
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.long_tests import rare
from tests.support.until import until


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit("box", **{**SPEC, **spec})
    with farm.monitor():
        farm.render(8)
        until(lambda: farm.jobs.get(job.id).finished_at is not None, 60)
    return farm.jobs.get(job.id)


def merged(farm: NoiseFarm, job: Job, spp: int) -> Pixels:
    """The linear image of a job's first slices."""
    merge = Merge(slice_spp=25)
    ledger = farm.jobs.ledger(job.id)
    for index in range(spp // 25):
        merge.add(decode_partial(farm.store.get(ledger[index]["blob"])).pixels)
    return merge.image()


def side(page: Page, number: int, kind: str) -> Locator:
    return page.locator(f".side {kind}").nth(number)


class TestAJobThatKeptItsSlices:
    @pytest.fixture
    def job(self, farm: NoiseFarm) -> Job:
        return finished(farm, keep_slices=True)

    def test_any_two_points_of_its_curve(self, visit: Visit, farm: NoiseFarm, job: Job) -> None:
        page = visit(f"/jobs/{job.id}").page
        page.get_by_role("button", name="Compare").click()
        left, right = (page.get_by_role("combobox", name=name) for name in ("Left", "Right"))
        points = [point.spp for point in farm.jobs.curve(job.id)]
        assert len(kept(farm.store, job.id)) < len(points) == 8
        for select in (left, right):
            names = [f"{spp} spp" for spp in points]
            expect(select.locator("option")).to_have_text([*names, "final image"])
        for one, other in ((75, 175), (175, 50)):
            left.select_option(str(one))
            right.select_option(str(other))
            for number, spp in ((0, one), (1, other)):
                picture = encode_srgb(merged(farm, job, spp), 0).astype(np.int16)
                is_shown(side(page, number, "img"), picture)
        expect(page.get_by_text("Every point of the curve")).to_be_visible()

    def test_both_at_one_exposure(self, visit: Visit, job: Job) -> None:
        page = visit(f"/jobs/{job.id}").page
        page.get_by_role("button", name="Compare").click()
        both = [side(page, number, "img") for number in (0, 1)]
        page.get_by_label("Exposure").fill("3.5")
        for image in both:
            expect(image).to_have_css("filter", 'url("#exposure")')
        expect(page.get_by_text("white areas stay flat")).to_be_visible()
        # The image alone keeps it, and a map has none
        page.get_by_role("button", name="Image", exact=True).click()
        expect(both[0]).to_have_css("filter", 'url("#exposure")')
        expect(page.locator(".side").last).to_be_hidden()
        page.get_by_role("button", name="Difference").click()
        expect(both[0]).to_have_css("filter", "none")


class TestAJobThatKeptPictures:
    @pytest.fixture
    def job(self, farm: NoiseFarm) -> Job:
        return finished(farm)

    def test_says_what_it_kept(self, visit: Visit, farm: NoiseFarm, job: Job) -> None:
        page = visit(f"/jobs/{job.id}").page
        page.get_by_role("button", name="Compare").click()
        count = len(kept(farm.store, job.id))
        words = f"The job kept pictures of {count} point{'s' if count > 1 else ''} out of 8"
        expect(page.get_by_text(words)).to_be_visible()


@pytest.mark.parametrize("scheme", ["light", *rare("dark")])
def test_anybody_can_compare(visit: Visit, farm: NoiseFarm, scheme: str) -> None:
    job = finished(farm)
    page = visit(f"/jobs/{job.id}", color_scheme=scheme, bypass_csp=True).page
    page.get_by_role("button", name="Compare").click()
    expect(side(page, 0, "img")).to_be_visible()
    page.get_by_label("Exposure").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    expect(page.get_by_text("+0.3 EV")).to_be_visible()
    assert violations(page) == []
