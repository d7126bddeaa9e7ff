"""Takes the pictures of the page that the README and docs/page.md show: ``make screenshots``.

Real jobs on a real farm in a real browser; some minutes, most of them rendering.
"""

import tempfile
import time
from pathlib import Path
from typing import Final

from PIL import Image
from playwright.sync_api import Browser, Page

from tests.support.browser import Visitor, chromium
from tests.support.real_farm import BOX, RealFarm

IMAGES: Final = Path(__file__).parents[2] / "docs" / "images"
SCENES: Final = BOX.parent
WATCH: Final = [{"name": "reverse"}, {"name": "myszkowski"}]
RULE: Final = {"name": "visible", "target": 0.002, "min_spp": 100}
SIZE: Final = {"width": 256, "height": 256}
#: So long a job may render, in seconds.
PATIENCE_S: Final = 900
#: So long pictures and curves take to come.
SETTLES_MS: Final = 2500


def take(page: Page, name: str) -> None:
    """Write what the page shows."""
    page.wait_for_timeout(SETTLES_MS)
    path = IMAGES / f"page-{name}.png"
    page.screenshot(path=path)
    Image.open(path).convert("RGB").save(path, optimize=True)
    print(path, path.stat().st_size)


def until(farm: RealFarm, job_id: str, spp: int) -> None:
    """Wait until so much of a job is merged, or it has ended."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        job = farm.jobs.get(job_id)
        if job.spp >= spp or job.finished_at is not None:
            return
        time.sleep(0.5)
    raise TimeoutError(job_id)


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
    page.get_by_role("button", name="Zones").click()
    page.wait_for_timeout(SETTLES_MS)
    page.locator(".viewer").screenshot(path=IMAGES / "page-zones.png")
    page.goto("/submit")
    stored = page.get_by_label("A stored scene")
    stored.select_option(label=stored.locator("option").last.inner_text())
    take(page, "submit")
    page.set_viewport_size({"width": 1280, "height": 640})
    page.goto("/")
    take(page, "jobs")
    visitor.leave()
    visitor = look(color_scheme="dark")
    visitor.page.goto(f"/jobs/{rendering}")
    take(visitor.page, "rendering")
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
        box = farm.submit(BOX, step=25, max_spp=5000, watch=WATCH, rule=RULE, parameters=SIZE)
        until(farm, box.id, 5000)
        lamps = [
            farm.submit(
                SCENES / "oculist",
                step=50,
                max_spp=2000,
                watch=WATCH,
                rule=RULE,
                batch="lamps",
                parameters={"width": 128, "height": 128, "intensity": intensity},
            )
            for intensity in (20, 80)
        ]
        until(farm, lamps[1].id, 100)
        bar = farm.submit(
            SCENES / "bar",
            step=25,
            max_spp=3000,
            watch=WATCH,
            rule=RULE,
            priority=5,
            parameters={"width": 320, "height": 240},
        )
        until(farm, bar.id, 250)
        farm.submit(SCENES / "plants", step=50, max_spp=3000, parameters=SIZE)
        take_all(browser, farm, converged=box.id, rendering=bar.id)
        for job in farm.client.jobs().jobs:
            if not job.state.ended:
                farm.client.cancel(job.id)


if __name__ == "__main__":
    main()
