"""An observer study in the browser: a simulated observer's known threshold comes back."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect
from typer.testing import CliRunner

from plateau.client import Client
from plateau.commands import app, meet_extensions
from plateau.farm.model.job import Job
from plateau.study.client import StudyCalls
from plateau.study.model import Screen
from tests.page.conftest import Visit
from tests.page.job.conftest import is_shown, png
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import SCREEN, ended_job, sees
from tests.support.long_tests import rare
from tests.support.processes.browser import violations

meet_extensions()


#: The simulated observers see a difference in half of the pairs here, and less often beyond.
THRESHOLD, SPREAD = 1300.0, 250.0
OBSERVERS = 12  #: the first of them in the browser


@pytest.fixture
def job(farm: NoiseFarm) -> Job:
    return ended_job(farm, slices=25, slice_spp=100, name="box.zip")


@pytest.fixture
def reference(farm: NoiseFarm) -> Job:
    return ended_job(farm, slices=50, slice_spp=200, film_from=1000, seed=1, name="truth.zip")


@pytest.fixture
def api(url: str) -> Iterator[Client]:
    with Client(url) as api:
        yield api


def answers(observer: str, shown: dict[str, Any]) -> bool:
    spp = int(re.findall(r"levels/(\d+)\.png", f"{shown['left']} {shown['right']}")[0])
    return sees(observer, spp, shown["reference"], threshold=THRESHOLD, spread=SPREAD)


def observe(client: Client, study_id: str, name: str) -> None:
    """Take part as the page does, without one."""
    observer = StudyCalls(client).take_part(study_id, name, Screen.model_validate(SCREEN))
    for trial in observer.trials:
        seen = answers(name, trial.model_dump())
        StudyCalls(client).answer(study_id, name, trial.trial, seen=seen, seconds=1.0)


def look_at(page: Page, client: Client, study_id: str, name: str, trials: range) -> None:
    """Answer to these pairs by the keyboard and the mouse in turn."""
    observer = StudyCalls(client).take_part(study_id, name, Screen.model_validate(SCREEN))
    yes, no = page.get_by_role("button", name="I see"), page.get_by_role("button", name="I don't")
    for number in trials:
        expect(page.locator(".pair-count")).to_have_text(f"{number + 1} of {len(observer.trials)}")
        expect(yes).to_be_enabled()
        seen = answers(name, observer.trials[number].model_dump())
        if number % 2:
            (yes if seen else no).click()
        else:
            page.keyboard.press("d" if seen else "s")


@pytest.mark.long
def test_a_known_threshold_comes_back(
    visit: Visit, url: str, api: Client, farm: NoiseFarm, job: Job, reference: Job, tmp_path: Path
) -> None:
    # Given a study that is made of a job on its page
    visitor = visit(f"/jobs/{job.id}")
    page = visitor.page
    page.get_by_role("button", name="Study…").click()
    page.get_by_label("Name").fill("BOX 1")
    page.get_by_label("Reference", exact=True).select_option(reference.id)
    page.get_by_role("button", name="Make the study").click()
    expect(page.get_by_role("heading", name="BOX 1")).to_be_visible()
    [study] = StudyCalls(api).all()
    assert study.levels == (100, 500, 900, 1300, 1700, 2100, 2500)
    assert (study.reference_spp, study.independent) == (10_000, True)

    # When an observer takes part, at a screen that is measured by a card
    page.get_by_role("link", name="Take part").click()
    expect(page.get_by_role("heading", name="Do you see a difference?")).to_be_visible()
    page.get_by_label("Pseudonym").fill("o-1")
    page.get_by_label("Width of the rectangle").fill("428")
    page.get_by_label("The rectangle is as wide as my card").check()
    page.get_by_label("From your eyes to the screen").fill("70")
    expect(page.locator(".calibration")).to_contain_text("61.1 pixels in a degree")
    page.get_by_label("From a step further away").select_option("true")
    page.get_by_role("button", name="Continue").click()
    expect(page.get_by_text("14 pairs to look at, from 70 cm.")).to_be_visible()
    page.get_by_role("button", name="Begin").click()

    # Then two pictures are shown, pixel by pixel, and the first answers are given
    [first, *_] = StudyCalls(api).take_part(study.id, "o-1", Screen.model_validate(SCREEN)).trials
    left, right = (page.get_by_alt_text(f"The {side} picture") for side in ("left", "right"))
    expect(left).to_be_visible()
    for shown, path in ((left, first.left), (right, first.right)):
        blob = f"studies/{study.id}/" + path.rpartition("/")[2]
        if path != study.links["reference"]:
            blob = f"studies/{study.id}/{int(path.rpartition('/')[2][:-4]):07d}.png"
        is_shown(shown, png(farm.store.get(blob)))
        assert shown.evaluate("one => one.getBoundingClientRect().width") == study.width
    look_at(page, api, study.id, "o-1", range(5))
    expect(page.locator(".pair-count")).to_have_text("6 of 14")
    # Who stops for now, or loads the page again, goes on where it stood
    page.get_by_role("button", name="Stop for now").click()
    expect(page.get_by_role("button", name="Continue")).to_be_visible()
    page.reload()
    expect(page.get_by_role("heading", name="Welcome back, o-1")).to_be_visible()
    expect(page.get_by_text("9 pairs to look at")).to_be_visible()
    page.get_by_role("button", name="Continue").click()
    look_at(page, api, study.id, "o-1", range(5, 14))
    expect(page.get_by_role("heading", name="Thank you, that is all")).to_be_visible()

    # And when others have taken part, the threshold is where they had it
    for number in range(2, OBSERVERS + 1):
        observe(api, study.id, f"o-{number}")
    page.goto(f"/studies/{study.id}")
    expect(page.get_by_role("heading", name="12 observers finished · 168 answers")).to_be_visible()
    expect(page.locator(".study-plot .dot")).to_have_count(7)
    half, _ = StudyCalls(api).get(study.id).result.thresholds
    expect(page.locator(".threshold").first).to_contain_text(f"{half.spp:,.0f} spp")

    trials, plot = tmp_path / "trials.csv", tmp_path / "fit.png"
    run = CliRunner().invoke
    assert run(app, ["study", "export", study.id, "-o", str(trials), "--url", url]).exit_code == 0
    fitted = run(app, ["study", "fit", str(trials), "--plot", str(plot), "--json"])
    [found] = json.loads(fitted.stdout)
    assert (found["scene"], found["answers"], found["observers"]) == ("BOX 1", 168, 12)
    low, high = found["interval_spp"]["0.5"]
    assert low < THRESHOLD < high
    assert high - low < 500
    assert found["threshold_spp"]["0.5"] == pytest.approx(half.spp)
    assert plot.stat().st_size > 10_000
    # The screen was kept with the answers
    assert StudyCalls(api).take_part(
        study.id, "o-1", Screen.model_validate(SCREEN)
    ).screen == Screen(viewing_distance_cm=70.0, pixel_pitch_mm=0.2, gamma_matches=True)


def test_making_one_says_what_it_waits_for(visit: Visit, job: Job, reference: Job) -> None:
    page = visit(f"/jobs/{job.id}", bypass_csp=True).page
    page.route("**/v1/studies", lambda route: None)  # which answers nothing
    page.get_by_role("button", name="Study…").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Reference", exact=True).select_option(reference.id)
    dialog.get_by_role("button", name="Make the study").click()
    expect(dialog.get_by_role("status")).to_contain_text("Merging 75 slices.")
    expect(dialog.get_by_role("progressbar")).to_be_visible()
    expect(dialog.get_by_role("button", name="Make the study")).to_be_disabled()
    assert violations(page) == []


def test_the_first_stage_leads_to_the_second(visit: Visit, api: Client, job: Job) -> None:
    study = StudyCalls(api).create(
        job.id, method="limits", levels=[100, 500, 1000, 1500, 2000, 2500]
    )
    for name in ("o-1", "o-2"):
        observe(api, study.id, name)
    page = visit(f"/studies/{study.id}", expected={404}).page  # a poll of one just deleted
    expect(page.get_by_text("The reference contains the samples")).to_be_visible()
    suggested = StudyCalls(api).get(study.id).result.suggested_levels
    page.get_by_role("button", name="Make the second stage").click()
    expect(page.get_by_text("constant stimuli")).to_be_visible()
    [second, _] = StudyCalls(api).all()
    assert (second.method, second.levels) == ("constant", tuple(suggested))
    # What is done with can be deleted
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("button", name="Delete it").click()
    expect(page.get_by_role("heading", name="Observer studies")).to_be_visible()
    expect(page.locator(".study-row")).to_have_count(1)
    expect(page.locator(".study-row")).to_contain_text("first stage, rising and falling")


def test_pictures_that_do_not_fit_are_not_made_smaller(visit: Visit, api: Client, job: Job) -> None:
    study = StudyCalls(api).create(job.id)
    StudyCalls(api).take_part(study.id, "o-1", Screen.model_validate(SCREEN))
    options = {"viewport": {"width": 120, "height": 740}}
    page = visit(f"/studies/{study.id}/observe?as=o-1", **options).page
    expect(page.get_by_text("Both pictures side by side need a window of")).to_be_visible()
    expect(page.get_by_role("button", name="Begin")).to_be_disabled()
    page.set_viewport_size({"width": 800, "height": 600})
    expect(page.get_by_role("button", name="Begin")).to_be_enabled()


@pytest.mark.parametrize("scheme", ["light", *rare("dark")])
def test_anybody_can_take_part(visit: Visit, api: Client, job: Job, scheme: str) -> None:
    study = StudyCalls(api).create(job.id)
    for name in ("o-1", "o-2"):
        observe(api, study.id, name)
    page = visit(color_scheme=scheme, bypass_csp=True, reduced_motion="reduce").page
    for path, place in (
        ("/studies", ".study-row"),
        (f"/studies/{study.id}", ".study-plot"),
        (f"/studies/{study.id}/observe", ".calibration"),
    ):
        page.goto(path)
        expect(page.locator(place).first).to_be_visible()
        assert violations(page) == [], path
    widths = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert widths[0] <= widths[1]
    page.get_by_label("The rectangle is as wide as my card").check()
    page.get_by_role("button", name="Continue").click()
    page.get_by_role("button", name="Begin").click()
    expect(page.get_by_role("button", name="I see")).to_be_enabled()
    assert violations(page) == []
