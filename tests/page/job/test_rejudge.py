"""Judging the kept slices of a job again, from its screen."""

import pytest
from playwright.sync_api import expect

from tests.page.conftest import Visit
from tests.page.job.test_compare import finished
from tests.page.test_access import violations
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.until import until


def test_a_job_is_judged_again(visit: Visit, farm: NoiseFarm) -> None:
    job = finished(farm, keep_slices=True)
    page = visit(f"/jobs/{job.id}", expected={404, 422}).page
    page.get_by_role("button", name="Judge again…").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("up to 200 spp, and shows where it would have stopped")
    # It starts with what was
    expect(dialog.get_by_label("The rule that ends it")).to_have_value("fixed")
    expect(dialog.get_by_label("Stop at")).to_have_value("200")
    expect(dialog.get_by_label("Judge every")).to_have_value("25")
    expect(dialog.get_by_label("No noise left to see")).to_be_checked()
    # What cannot be, if only the service knows it, is said where it is
    dialog.get_by_label("Judge every").evaluate("input => input.removeAttribute('max')")
    dialog.get_by_label("Judge every").fill("2000000")
    dialog.get_by_role("button", name="Judge it").click()
    expect(dialog.get_by_role("alert")).to_contain_text("must be at most 1,000,000")
    dialog.get_by_label("Judge every").fill("50")
    dialog.get_by_label("The rule that ends it").select_option("reverse")
    dialog.get_by_label("Points in the line").fill("3")
    dialog.get_by_label("Image width seen under").fill("20")
    dialog.get_by_label("Exposure").fill("-1")
    dialog.get_by_role("button", name="Judge it").click()
    expect(page.get_by_text("It continues an earlier job")).to_be_visible()
    new = farm.jobs.get(page.url.rpartition("/")[2])
    assert (new.continues, new.spec.max_spp, new.spec.step) == (job.id, 200, 50)
    rule = new.spec.rule.model_dump()
    assert (rule["name"], rule["window"], rule["epsilon"]) == ("reverse", 3, 0.1)
    assert (new.spec.view.field_of_view_deg, new.spec.view.exposure_ev) == (20, -1)
    # The parameters of a watched rule stay
    assert [rule.model_dump() for rule in new.spec.watch] == [
        {"name": "visible", "target": 0.001, "min_spp": 200}
    ]
    with farm.monitor():
        until(lambda: farm.jobs.get(new.id).finished_at is not None, 60)
    assert farm.jobs.get(new.id).points
    assert farm.jobs.get(new.id).machine_s == 0


def test_only_where_slices_were_kept(visit: Visit, farm: NoiseFarm) -> None:
    page = visit(f"/jobs/{finished(farm).id}").page
    expect(page.get_by_role("button", name="Continue…")).to_be_visible()
    expect(page.get_by_role("button", name="Judge again…")).to_have_count(0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_anybody_can_judge_again(visit: Visit, farm: NoiseFarm, scheme: str) -> None:
    job = finished(farm, keep_slices=True)
    options = {"viewport": {"width": 360, "height": 740}, "bypass_csp": True}
    page = visit(f"/jobs/{job.id}", color_scheme=scheme, **options).page
    page.get_by_role("button", name="Judge again…").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_be_visible()
    assert violations(page) == []
    widths = page.evaluate(
        "() => { const { scrollWidth, clientWidth } = document.querySelector('dialog');"
        " return [scrollWidth, clientWidth]; }"
    )
    assert widths[0] <= widths[1]
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(page.get_by_role("button", name="Judge again…")).to_be_focused()
