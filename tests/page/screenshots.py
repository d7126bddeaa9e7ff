"""Takes the pictures of the page that the README and docs/page.md show: ``make screenshots``.

Real jobs on a real farm in a real browser; some minutes, most of them rendering.
"""

import tempfile
from pathlib import Path
from typing import Final

from PIL import Image
from playwright.sync_api import Browser, Page, expect

from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.views import JobView
from plateau.study.client import StudyCalls
from plateau.study.model import Screen
from tests.support.farms.real_farm import BOX, RealFarm
from tests.support.farms.studies import SCREEN, sees
from tests.support.processes.browser import Visitor, chromium
from tests.support.until import until

IMAGES: Final = Path(__file__).parents[2] / "docs" / "images"
SCENES: Final = BOX.parent
WATCH: Final = [{"name": "reverse"}, {"name": "myszkowski"}]
SIZE: Final = {"width": 256, "height": 256}
#: So long a job may render, in seconds.
PATIENCE_S: Final = 900
#: Simulated ones, of the study.
OBSERVERS: Final = 12
#: So long pictures and curves take to come.
SETTLES_MS: Final = 2500


def take(page: Page, name: str) -> None:
    """Write what the page shows."""
    page.wait_for_timeout(SETTLES_MS)
    path = IMAGES / f"page-{name}.png"
    page.screenshot(path=path)
    Image.open(path).convert("RGB").save(path, optimize=True)
    print(path, path.stat().st_size)


def submit(farm: RealFarm, scene: Path, **spec: object) -> JobView:
    """Submit a job with the product's defaults, and not those of the tests."""
    return farm.client.submit(scene, JobSpec.model_validate(spec))


def until_merged(farm: RealFarm, job_id: str, spp: int) -> None:
    """Wait until so much of a job is merged, or it has ended."""
    until(
        lambda: (job := farm.jobs.get(job_id)).spp >= spp or job.finished_at,
        PATIENCE_S,
        every_s=0.5,
    )


def take_all(browser: Browser, farm: RealFarm, *, converged: str, rendering: str) -> None:
    """Take every picture, of a job that has converged and one that renders."""

    def look(**options: object) -> Visitor:
        return Visitor(browser, farm.url, viewport={"width": 1280, "height": 900}, **options)

    visitor = look(color_scheme="light")
    visitor.expected = {404}
    page = visitor.page
    page.set_viewport_size({"width": 1280, "height": 1000})
    page.goto(f"/jobs/{converged}")
    page.get_by_role("button", name="Compare").click()
    take(page, "job")
    page.goto("/submit")
    stored = page.get_by_label("A stored scene")
    expect(stored.locator("option").nth(1)).to_be_attached()
    stored.select_option(label=stored.locator("option").last.inner_text())
    expect(page.get_by_text("Its parameters")).to_be_visible()
    take(page, "submit")
    page.set_viewport_size({"width": 1280, "height": 640})
    page.goto("/")
    take(page, "jobs")
    visitor.leave()
    visitor = look(color_scheme="dark")
    visitor.page.goto(f"/jobs/{rendering}")
    take(visitor.page, "rendering")
    visitor.leave()


def take_study(browser: Browser, farm: RealFarm, *, job: str, reference: str) -> None:
    """Take pictures of a pair of a study, and of what simulated observers have found."""
    study = StudyCalls(farm.client).create(
        job, reference_job_id=reference, name="Box, by lamp light"
    )
    threshold = study.levels[len(study.levels) // 2]
    for number in range(OBSERVERS):
        name = f"o-{number + 1}"
        observer = StudyCalls(farm.client).take_part(study.id, name, Screen.model_validate(SCREEN))
        for trial in observer.trials:
            spp = study.levels[0]
            for side in (trial.left, trial.right):
                if "levels" in side:
                    spp = int(Path(side).stem)
            seen = sees(name, spp, trial.reference, threshold=threshold, spread=threshold / 5)
            StudyCalls(farm.client).answer(study.id, name, trial.trial, seen=seen, seconds=4.0)
    visitor = Visitor(
        browser, farm.url, viewport={"width": 1280, "height": 860}, color_scheme="light"
    )
    page = visitor.page
    page.goto(f"/studies/{study.id}")
    take(page, "study")
    StudyCalls(farm.client).take_part(study.id, "you", Screen.model_validate(SCREEN))
    page.set_viewport_size({"width": 900, "height": 480})
    page.goto(f"/studies/{study.id}/observe?as=you")
    page.get_by_role("button", name="Begin").click()
    take(page, "study-pair")
    visitor.leave()


def main() -> None:
    """Render, look, and take pictures."""
    with (
        tempfile.TemporaryDirectory() as folder,
        RealFarm(Path(folder), Path(folder) / "cache", PLATEAU_THREADS="2") as farm,
        chromium() as browser,
    ):
        farm.start("monitor")
        farm.workers(1)
        box = submit(farm, BOX, parameters=SIZE)
        # A study needs slices of whole frames, which its levels are made of
        kept = {"parameters": SIZE, "keep_slices": True}
        levels = submit(farm, BOX, step=25, rule={"name": "fixed", "spp": 400}, **kept)
        truth = submit(farm, BOX, seed=1, rule={"name": "fixed", "spp": 800}, **kept)
        for job in (box, levels, truth):  # until their results are written
            until(lambda job=job: farm.jobs.get(job.id).finished_at, PATIENCE_S, every_s=0.5)
        lamps = [
            submit(
                farm,
                SCENES / "oculist",
                max_spp=2000,
                batch="lamps",
                parameters={"width": 128, "height": 128, "intensity": intensity},
            )
            for intensity in (20, 80)
        ]
        until_merged(farm, lamps[1].id, 100)
        size = {"width": 320, "height": 240}
        bar = submit(farm, SCENES / "bar", watch=WATCH, priority=5, parameters=size)
        until_merged(farm, bar.id, 250)
        submit(farm, SCENES / "plants", parameters=SIZE)
        take_all(browser, farm, converged=box.id, rendering=bar.id)
        take_study(browser, farm, job=levels.id, reference=truth.id)
        for job in farm.client.all_jobs():
            if not job.state.ended:
                farm.client.cancel(job.id)


if __name__ == "__main__":
    main()
