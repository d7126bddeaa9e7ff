"""Where the samples of a job by zones went: a map over its image, with a scale."""

import re
from pathlib import Path

import numpy as np
import pytest
import redis
from playwright.sync_api import expect

from plateau.metric.pictures import SAMPLES_PALETTE
from tests.page.conftest import Visit, paired
from tests.page.job.conftest import is_shown, png
from tests.support.farms.finished_jobs import finished
from tests.support.farms.lopsided_farm import JOB, LopsidedFarm
from tests.support.farms.noise_farm import NoiseFarm

STYLE = Path(__file__).parents[3] / "plateau" / "service" / "page" / "job" / "viewer" / "viewer.css"


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, folder: Path) -> NoiseFarm:
    return paired(LopsidedFarm(client, redis_url, folder, sigma=0.15))


def test_they_are_shown_with_their_scale(visit: Visit, farm: NoiseFarm) -> None:
    job = finished(farm, **JOB, keep_slices=True)
    assert job.spp_min is not None
    assert job.spp_max is not None
    page = visit(f"/jobs/{job.id}").page
    between = f"{job.spp:,} spp ({job.spp_min:,} to {job.spp_max:,})"
    expect(page.locator(".reason")).to_contain_text(f"It stopped by itself at {between}")
    expect(page.locator(".facts")).to_contain_text(f"zones {job.spp_min:,} to {job.spp_max:,}")
    page.get_by_role("button", name="Samples", exact=True).click()
    is_shown(page.locator("img.layer").last, png(farm.picture(job, "spp.png")))
    expect(page.locator(".caption")).to_contain_text("zones of 16 × 16 pixels")
    middle = round((job.spp_min * job.spp_max) ** 0.5)
    expect(page.locator(".scale:visible output")).to_have_text(
        [f"{job.spp_min:,} spp", f"{middle:,}", f"{job.spp_max:,} spp"]
    )
    # It can be made transparent, and so can the difference, and nothing else
    for name in ("Samples", "Difference"):
        page.get_by_role("button", name=name, exact=True).click()
        page.get_by_label("Overlay").fill("40")
        expect(page.locator(".side").last).to_have_css("opacity", "0.4")
    page.get_by_role("button", name="Image", exact=True).click()
    expect(page.get_by_label("Overlay")).to_be_hidden()
    # It can be saved
    with page.expect_download() as download:
        page.locator(".files").get_by_role("link", name="Samples").click()
    assert download.value.path().read_bytes() == farm.picture(job, "spp.png")
    # Its slices make no study, which compares whole frames
    expect(page.get_by_role("button", name="Study…")).to_be_hidden()


@pytest.mark.long
def test_they_change_while_it_renders(visit: Visit, farm: NoiseFarm) -> None:
    job = farm.submit(**{**JOB, "rule": {"name": "fixed", "spp": 200}})
    with farm.monitor():
        farm.render(4)  # to the first point, and no further
        page = visit(f"/jobs/{job.id}", expected={404}).page
        page.get_by_role("button", name="Samples", exact=True).click()
        # At first all zones have the same
        expect(page.locator(".scale:visible output").last).to_have_text("40 spp")
        farm.finish(job)
        done = farm.jobs.get(job.id)
        expect(page.locator(".scale:visible output").last).to_have_text(f"{done.spp_max:,} spp")


def test_its_scale_has_the_colours_of_the_map() -> None:
    shown = re.findall(r"#([0-9a-f]{6})", re.search(r"\.viridis .*", STYLE.read_text())[0])
    colours = [[int(colour[at : at + 2], 16) for at in (0, 2, 4)] for colour in shown]
    places = np.rint(np.linspace(0, 255, len(shown))).astype(int)
    assert np.abs(SAMPLES_PALETTE[places].astype(int) - colours).max() <= 1
