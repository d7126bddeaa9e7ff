"""An image looked at closely: its pixels, and another job beside it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from plateau.farm.blobs import names as blobs
from plateau.farm.model.job import Job
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from plateau.picture.previews import kept
from tests.page.conftest import Visit
from tests.page.job.test_job import SPEC, is_shown, png
from tests.page.test_access import violations
from tests.support.farms.every_time import save_every_time
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.long_tests import rare
from tests.support.processes.browser import Visitor
from tests.support.until import until

SHORT = {"step": 25, "max_spp": 50, "rule": {"name": "fixed", "spp": 50}}


@dataclass(frozen=True)
class Two:
    """Two finished jobs of one size, and where they can be seen."""

    farm: NoiseFarm
    one: Job
    other: Job
    url: str


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Two]:
    """Only looked at, so they are rendered once, with a Redis of their own."""
    folder = tmp_path_factory.mktemp("two")
    server = EmbeddedRedis(folder / "redis")
    client = connect(server.url)
    farm = NoiseFarm(client, server.url, folder)
    with farm.monitor():
        one = farm.finish(farm.submit("dusk", **SHORT))
        other = farm.finish(farm.submit("dawn", **SHORT, seed=7))
    with live_api(server.url, farm.store) as url:
        yield Two(farm, one, other, url)
    client.close()
    server.stop()


@pytest.fixture(scope="module")
def looker(browser: Browser, two: Two) -> Iterator[Visitor]:
    visitor = Visitor(browser, two.url)
    yield visitor
    visitor.leave()


@pytest.fixture
def page(looker: Visitor, two: Two) -> Page:
    """The first job's screen, as it is at first."""
    looker.page.mouse.move(0, 0)
    looker.page.goto(f"/jobs/{two.one.id}")
    expect(looker.page.locator(".frame .layer").first).to_be_visible()
    return looker.page


def test_pixels_are_crisp(page: Page, two: Two) -> None:
    page.goto(f"/jobs/{two.other.id}")
    layer, frame = page.locator("img.layer").first, page.locator(".frame")
    picture = png(two.farm.picture(two.other, "image.png"))
    expect(layer).to_be_visible()
    # At 1:1, each is one of the display's
    frame.press("1")
    expect(page.locator(".zoom")).to_have_text("100 %")
    # (all but the edge, which the browser blends with what is behind it)
    assert (png(layer.screenshot()) == picture)[1:-1, 1:-1].all()
    # Zoomed, each has sharp edges: no colour lies between those of two
    frame.press("0")
    colours = {tuple(colour) for colour in picture.reshape(-1, 3)}
    inside = png(layer.screenshot())[4:-4, 4:-4].reshape(-1, 3)
    assert {tuple(colour) for colour in inside} <= colours


class TestTwoJobs:
    def test_are_compared_and_flipped(self, page: Page, two: Two, looker: Visitor) -> None:
        page.get_by_role("button", name="Compare").click()
        page.get_by_label("The other job").select_option(two.other.id)
        for side in ("Left", "Right"):
            page.get_by_role("combobox", name=side).select_option(label="final image")
        for number, job in enumerate((two.one, two.other)):
            layer = page.locator(".side img").nth(number)
            expect(layer).to_be_visible()
            is_shown(layer, png(two.farm.picture(job, "image.png")))
        expect(page).to_have_url(re.compile(f"{two.one.id}\\?with={two.other.id}$"))
        one, other = f"dusk {two.one.id[:6]}", f"dawn {two.other.id[:6]}"
        caption = page.locator(".caption")
        expect(caption).to_contain_text(f"{one}, final image at the left, {other}, final image at")
        page.locator(".frame").focus()
        for key, clip, alone in (("f", "0%", other), ("f", "100%", one), ("f", "0%", other)):
            page.keyboard.press(key)
            expect(page.locator(".side").last).to_have_css(
                "clip-path", f"inset(0px 0px 0px {clip})"
            )
            expect(caption).to_contain_text(f"{alone}, final image alone")
        # A reload comes back to the same two
        page.reload()
        expect(page.get_by_label("The other job")).to_have_value(two.other.id)
        # They are chosen in the list, too
        page.goto("/")
        page.get_by_role("checkbox", name="Select dusk").check()
        link = page.get_by_role("link", name="Compare", exact=True)
        expect(link).to_be_hidden()
        page.get_by_role("checkbox", name="Select dawn").check()
        link.click()
        expect(page).to_have_url(re.compile(r"/jobs/\w+\?with=\w+$"))
        expect(page.locator(".side").last).to_be_visible()
        # One that is not there, or of another size, is said so
        looker.expected = {404}
        page.goto(f"/jobs/{two.one.id}?with=0123456789ab")
        hint = "Job 0123456789ab has no image of 32 × 24 pixels to compare."
        expect(page.get_by_text(hint)).to_be_visible()
        looker.expected = set()


def finished(farm: NoiseFarm, **spec: object) -> Job:
    job = farm.submit("box", **{**SPEC, **spec})
    with farm.monitor():
        farm.render(8)
        until(lambda: farm.jobs.get(job.id).finished_at is not None, 60)
    return farm.jobs.get(job.id)


def side(page: Page, number: int, kind: str) -> Locator:
    return page.locator(f".side {kind}").nth(number)


def test_any_two_kept_pictures_at_one_exposure(
    visit: Visit, farm: NoiseFarm, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_every_time(monkeypatch)
    job = finished(farm)
    page = visit(f"/jobs/{job.id}").page
    page.get_by_role("button", name="Compare").click()
    left, right = (page.get_by_role("combobox", name=name) for name in ("Left", "Right"))
    pictures = kept(farm.store, job.id)
    for select in (left, right):
        names = [f"{spp} spp" for spp in pictures]
        expect(select.locator("option")).to_have_text([*names, "final image"])
    first, *_, last = pictures
    for one, other in ((first, last), (last, first)):
        left.select_option(str(one))
        right.select_option(str(other))
        for number, spp in ((0, one), (1, other)):
            is_shown(side(page, number, "img"), png(farm.store.get(blobs.preview(job.id, spp))))
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


@pytest.mark.parametrize("scheme", ["light", *rare("dark")])
def test_anybody_can_compare(visit: Visit, farm: NoiseFarm, scheme: str) -> None:
    job = finished(farm)
    page = visit(f"/jobs/{job.id}", color_scheme=scheme, bypass_csp=True).page
    page.get_by_role("button", name="Compare").click()
    expect(side(page, 0, "img")).to_be_visible()
    # It kept some pictures, and says so
    count = len(kept(farm.store, job.id))
    words = f"The job kept pictures of {count} point{'s' if count > 1 else ''} out of 8"
    expect(page.get_by_text(words)).to_be_visible()
    page.get_by_label("Exposure").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    expect(page.get_by_text("+0.3 EV")).to_be_visible()
    assert violations(page) == []
