"""A job's own screen: its image, its curve, and why it stopped."""

import re
from pathlib import Path

import numpy as np
import pytest
import redis
from playwright.sync_api import Page, expect

from plateau.metric import encode_srgb
from tests.page.conftest import Visit
from tests.page.job.conftest import SPEC, Finished, is_shown, pixels, png
from tests.support.farms.noise_farm import NoiseFarm, noise_film
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until


def test_a_job_is_watched_until_it_stops(visit: Visit, farm: NoiseFarm) -> None:
    job = farm.submit("box", **SPEC)
    visitor = visit(f"/jobs/{job.id}", expected={404})  # an image comes a moment after its point
    page = visitor.page
    expect(page.get_by_role("heading", name="box", exact=True)).to_be_visible()
    expect(
        page.get_by_text("It waits for a worker: there is none that takes work.")
    ).to_be_visible()
    expect(page.get_by_text("The curve begins at its first step, 25 spp.")).to_be_visible()
    with farm.monitor():
        # Its first pass is to be seen before there is a slice
        first = farm.next_lease()
        farm.glimpse(first, 4)
        expect(page.locator(".caption")).to_contain_text("4 spp")
        expect(page.locator(".story")).to_contain_text("The first image is there, of 4 spp.")
        farm.commit(first)
        farm.render(2)
        # Points come as they are made, without a reload
        expect(page.locator(".readout")).to_contain_text("75 spp")
        expect(page.locator(".caption")).to_contain_text("32 × 24")
        expect(page.locator("progress")).to_have_attribute("title", "75 of 200 spp")
        farm.render(5)
        expect(page.locator(".one-job .title .state")).to_have_text("converged")
        expect(page.locator(".reason")).to_contain_text("stopped by itself at 200 spp")
        # The final image, and the story with its last line
        expect(page.locator(".caption")).to_contain_text("200 spp")
        expect(page.locator(".story")).to_contain_text("Its results are written.")
    expect(page).to_have_title("box: converged · Plateau")
    # A number that was asked for saves nothing of a cap
    expect(page.locator(".facts")).to_contain_text("200 spp")
    expect(page.locator(".facts")).not_to_contain_text("saved")
    expect(page.get_by_role("button", name="Cancel")).to_have_count(0)


def test_the_image_is_the_one_that_was_judged_at_any_exposure_and_size(
    shown: Page, finished: Finished
) -> None:
    layer, frame = shown.locator("img.layer").first, shown.locator(".frame")
    picture = png(finished.farm.picture(finished.job, "image.png"))
    assert (pixels(layer) == picture).all()
    frame.focus()
    fitted = shown.locator(".zoom").inner_text()
    for key in ("+", "+"):
        shown.keyboard.press(key)
    middle = frame.evaluate("one => [one.scrollLeft, one.scrollTop]")
    expect(shown.locator(".sheet")).to_have_attribute("style", re.compile("width: 225%"))
    shown.keyboard.press("ArrowLeft")
    until(lambda: frame.evaluate("one => one.scrollLeft") < middle[0])
    shown.keyboard.press("0")
    expect(shown.locator(".zoom")).to_have_text(fitted)
    # The browser's own keys stay the browser's
    for key in ("Control+1", "Alt+1"):
        frame.press(key)
    expect(shown.locator(".zoom")).to_have_text(fitted)
    frame.press("1")
    expect(shown.locator(".zoom")).to_have_text("100 %")
    for ev in (-1.5, 2.0):
        shown.get_by_label("Exposure").fill(str(ev))
        codes = picture / 255
        light = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
        # All but the edge, which the browser blends with what is behind it
        wanted = encode_srgb(light.astype(np.float32), ev).astype(np.int16)[1:-1, 1:-1]
        seen = png(layer.screenshot())[1:-1, 1:-1]
        assert np.abs(seen - wanted).max() <= 1
        # And back to what was judged
        shown.get_by_role("button", name="As judged").click()
        expect(layer).to_have_css("filter", "none")


def test_the_image_is_compared_with_earlier_ones_by_a_wipe(shown: Page, finished: Finished) -> None:
    shown.get_by_role("button", name="Compare").click()
    below, above = (shown.locator(".side img").nth(number) for number in (0, 1))
    expect(above).to_be_visible()
    is_shown(below, finished.preview(finished.previews[0]))
    is_shown(above, png(finished.farm.picture(finished.job, "image.png")))
    # By pulling on it
    box = shown.locator(".frame").bounding_box()
    assert box is not None
    shown.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 20)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 30)
    shown.mouse.up()
    assert float(shown.get_by_label("Wipe").input_value()) == pytest.approx(75, abs=1)
    shown.get_by_label("Wipe").fill("25")
    upper = shown.locator(".side").last
    expect(upper).to_have_css("clip-path", "inset(0px 0px 0px 25%)")


def test_the_image_has_maps_over_it(shown: Page, finished: Finished) -> None:
    shown.get_by_role("button", name="Difference", exact=True).click()
    above = shown.locator("img.layer").last
    expect(above).to_be_visible()
    is_shown(above, png(finished.farm.picture(finished.job, "difference.png")))
    # And where its noise is left to see
    shown.get_by_role("button", name="Noise", exact=True).click()
    is_shown(above, png(finished.farm.picture(finished.job, "noise.png")))
    # Nothing of it is broken and all pixels have the same samples: no picture of that is offered
    for name in ("Broken", "Samples"):
        expect(shown.get_by_role("button", name=name, exact=True)).to_be_hidden()
    expect(shown.locator(".facts")).not_to_contain_text("zones")
    shown.get_by_label("Overlay").fill("40")
    expect(shown.locator(".side").last).to_have_css("opacity", "0.4")


def test_the_curve_is_read_by_keyboard_and_mouse_on_any_axis(
    shown: Page, finished: Finished
) -> None:
    shown.locator(".plots").focus()
    points = finished.farm.jobs.curve(finished.job.id)
    for point in points[:2]:
        shown.keyboard.press("ArrowRight")
        for place in (shown.locator(".readout"), shown.locator("#said")):
            expect(place).to_contain_text(f"{point.spp} spp")
            expect(place).to_contain_text(f"{point.visible_pixels} px")
    shown.keyboard.press("End")
    expect(shown.locator(".readout")).to_contain_text("200 spp")
    box = shown.locator(".plot .u-over").first.bounding_box()
    assert box is not None
    shown.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    expect(shown.locator(".readout")).to_contain_text("100 spp")
    shown.mouse.move(0, 0)

    def drawn() -> list[str]:
        return shown.locator(".plot canvas").evaluate_all("all => all.map(one => one.toDataURL())")

    before = drawn()
    assert len(before) == 2
    for toggle in shown.locator(".curve .toggle input").all():
        toggle.click()
        after = drawn()
        assert after != before
        before = after


def test_its_records_are_there_and_its_files_can_be_saved(
    shown: Page, finished: Finished, tmp_path: Path
) -> None:
    shown.locator("summary", has_text="Log").click()
    expect(shown.get_by_text("8 slices went through without trouble.")).to_be_visible()
    shown.get_by_text("What was asked").click()
    expect(shown.get_by_label("The job's spec")).to_contain_text('"max_spp": 250')
    for link, name, begins in (
        ("EXR", "image.exr", b"v/1\x01"),
        ("PNG", "image.png", b"\x89PNG"),
        ("Difference", "difference.png", b"\x89PNG"),
        ("Noise", "noise.png", b"\x89PNG"),
        ("CSV", "curve.csv", b"spp,visible_pixels"),
        ("Zip", "results.zip", b"PK"),
    ):
        with shown.expect_download() as download:
            shown.locator(".files").get_by_role("link", name=re.compile(f"^{link}")).click()
        assert download.value.suggested_filename == f"{finished.job.id}-{name}"
        download.value.save_as(tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(begins)


def test_a_job_of_broken_pixels_shows_where_they_are(visit: Visit, farm: NoiseFarm) -> None:
    # Given a scene with a mistake that makes a corner of its image NaN
    job = farm.submit("box", **SPEC)
    with farm.monitor():
        lease = farm.next_lease()
        film = noise_film(lease.index, 25, 1.0)
        film[:4, :5, 0] = np.nan
        farm.commit(lease, film)
        until(lambda: farm.is_finished(job))
    # Then the page says so, in words, in its figures and in a picture over the image
    page = visit(f"/jobs/{job.id}").page
    expect(page.locator(".one-job .title .state")).to_have_text("failed")
    expect(page.locator(".reason")).to_contain_text("20 of 768 pixels (2.6 %) are NaN")
    expect(page.locator(".facts")).to_contain_text("20 px")
    page.get_by_role("button", name="Broken").click()
    above = page.locator("img.layer").last
    expect(above).to_be_visible()
    is_shown(above, png(farm.picture(job, "non-finite.png")))
    expect(page.locator(".caption")).to_contain_text("20 pixels")
    expect(page.locator(".files").get_by_role("link", name="Broken")).to_be_visible()


def test_what_is_not_there_is_said_so(visit: Visit) -> None:
    page = visit("/jobs/0123456789ab", expected={404}).page
    expect(page.get_by_role("heading", name="There is no such job")).to_be_visible()
    expect(page.get_by_role("link", name="All jobs")).to_be_visible()
    # Nor can it be rendered again
    page.goto("/submit?again=0123456789ab")
    expect(page.get_by_role("alert").filter(has_text="there is no job")).to_be_visible()
    page.get_by_role("link", name="Submit a scene").last.click()
    expect(page.locator("#scene-file")).to_be_attached()
    # And there are paths without a screen
    page.goto("/job/box")
    expect(page.get_by_role("heading", name="There is nothing here")).to_be_visible()
    expect(page.get_by_text("No page of this farm is at /job/box.")).to_be_visible()
    page.get_by_role("link", name="Show the jobs").click()
    expect(page.get_by_role("heading", name="Jobs", exact=True)).to_be_visible()


def test_what_ends_a_job_is_its_first_plot_and_an_error_is_on_a_logarithmic_axis(
    visit: Visit, client: redis.Redis
) -> None:
    job = StagedJob(client, rule={"name": "rmse", "target": 0.01}, watch=[{"name": "jod"}])
    job.commit(8)
    for spp, error, jod in ((100, 0.4, None), (200, 0.02, 9.1)):
        rules = {"rmse": {"value": error, "stop": False}, "jod": {"value": jod, "stop": False}}
        job.point(spp, 9, rules=rules)
    page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".plot-title").first).to_have_text("RMSE in radiance, by the rule rmse")
    expect(page.locator(".plot-title").last).to_have_text("Quality in JOD, by the rule jod")
    expect(page.locator(".plot canvas")).to_have_count(4)
    page.locator(".plots").focus()
    page.keyboard.press("End")
    expect(page.locator(".readout")).to_contain_text("quality 9.1 JOD")
    kinds = """async () => {
      const { ValuePanel } = await import("/page/job/curve/panels.js");
      return ["rmse", "psnr", "jod"].map((name) => new ValuePanel({ name }).logarithmic);
    }"""
    assert page.evaluate(kinds) == [True, False, False]
