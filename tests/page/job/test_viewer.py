"""An image looked at closely: its pixels, and another job beside it."""

import re

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.page.conftest import Visit
from tests.page.job.conftest import Finished, is_shown, png
from tests.support.long_tests import rare
from tests.support.processes.browser import Visitor, violations


def test_pixels_are_crisp(shown: Page, finished: Finished) -> None:
    layer, frame = shown.locator("img.layer").first, shown.locator(".frame")
    picture = png(finished.farm.picture(finished.job, "image.png"))
    # Zoomed, each has sharp edges: no colour lies between those of two
    frame.press("0")
    colours = {tuple(colour) for colour in picture.reshape(-1, 3)}
    inside = png(layer.screenshot())[4:-4, 4:-4].reshape(-1, 3)
    assert {tuple(colour) for colour in inside} <= colours


def test_what_may_be_shown_does_not_come_and_go(shown: Page, finished: Finished) -> None:
    shown.add_init_script(
        """window.changes = 0;
        new MutationObserver((all) => {
          changes += all.filter(({ target }) => target.matches(".modes button")).length;
        }).observe(document, { subtree: true, attributeFilter: ["hidden"] });"""
    )
    shown.goto(f"/jobs/{finished.job.id}")
    expect(shown.locator(".frame .layer").first).to_be_visible()
    assert shown.evaluate("changes") == 0


def test_two_jobs_are_compared_and_flipped(
    shown: Page, finished: Finished, looker: Visitor
) -> None:
    # They are chosen in the list
    shown.goto("/")
    shown.get_by_role("checkbox", name="Select box").check()
    link = shown.get_by_role("link", name="Compare", exact=True)
    expect(link).to_be_hidden()
    shown.get_by_role("checkbox", name="Select dawn").check()
    link.click()
    expect(shown).to_have_url(re.compile(r"/jobs/\w+\?with=\w+$"))
    expect(side(shown, 1)).to_be_visible()
    shown.goto(f"/jobs/{finished.job.id}?with={finished.other.id}")
    for name in ("Left", "Right"):
        shown.get_by_role("combobox", name=name).select_option(label="final image")
    for number, job in enumerate((finished.job, finished.other)):
        is_shown(side(shown, number), png(finished.farm.picture(job, "image.png")))
    one, other = f"box {finished.job.id[:6]}", f"dawn {finished.other.id[:6]}"
    caption = shown.locator(".caption")
    expect(caption).to_contain_text(f"{one}, final image at the left, {other}, final image at")
    shown.locator(".frame").focus()
    for key, clip, alone in (("f", "0%", other), ("f", "100%", one), ("f", "0%", other)):
        shown.keyboard.press(key)
        expect(shown.locator(".side").last).to_have_css("clip-path", f"inset(0px 0px 0px {clip})")
        expect(caption).to_contain_text(f"{alone}, final image alone")
    # One that is not there, or of another size, is said so
    looker.expected = {404}
    shown.goto(f"/jobs/{finished.job.id}?with=0123456789ab")
    hint = "Job 0123456789ab has no image of 32 × 24 pixels to compare."
    expect(shown.get_by_text(hint)).to_be_visible()
    looker.expected = set()


def side(page: Page, number: int) -> Locator:
    return page.locator(".side img").nth(number)


def test_any_two_kept_pictures_at_one_exposure(shown: Page, finished: Finished) -> None:
    shown.goto(f"/jobs/{finished.job.id}")
    shown.get_by_role("button", name="Compare").click()
    left, right = (shown.get_by_role("combobox", name=name) for name in ("Left", "Right"))
    for select in (left, right):
        names = [f"{spp} spp" for spp in finished.previews]
        expect(select.locator("option")).to_have_text([*names, "final image"])
    first, *_, last = finished.previews
    for one, other in ((first, last), (last, first)):
        left.select_option(str(one))
        right.select_option(str(other))
        for number, spp in ((0, one), (1, other)):
            is_shown(side(shown, number), finished.preview(spp))
    shown.get_by_label("Exposure").fill("3.5")
    for number in (0, 1):
        expect(side(shown, number)).to_have_css("filter", 'url("#exposure")')
    expect(shown.get_by_text("white areas stay flat")).to_be_visible()
    # The image alone keeps it, and a map has none
    shown.get_by_role("button", name="Image", exact=True).click()
    expect(side(shown, 0)).to_have_css("filter", 'url("#exposure")')
    expect(shown.locator(".side").last).to_be_hidden()
    shown.get_by_role("button", name="Difference").click()
    expect(side(shown, 0)).to_have_css("filter", "none")


@pytest.mark.parametrize("scheme", ["light", *rare("dark")])
def test_anybody_can_compare(visit: Visit, finished: Finished, scheme: str) -> None:
    options = {"url": finished.url, "color_scheme": scheme, "bypass_csp": True}
    page = visit(f"/jobs/{finished.job.id}", **options).page
    page.get_by_role("button", name="Compare").click()
    expect(side(page, 0)).to_be_visible()
    # It kept some pictures, and says so
    words = f"The job kept pictures of {len(finished.previews)} points out of 8"
    expect(page.get_by_text(words)).to_be_visible()
    page.get_by_label("Exposure").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    expect(page.get_by_text("+0.3 EV")).to_be_visible()
    assert violations(page) == []
