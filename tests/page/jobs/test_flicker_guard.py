"""The flicker guard of a batch, in words and switched on."""

import pytest
import redis
from playwright.sync_api import Locator, Page, expect

from plateau.farm.ledger.batches import Batches
from tests.page.conftest import Visit
from tests.page.test_access import violations
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob

STOPS = {"rule": {"name": "visible", "target": 0.0002}, "min_spp": 100}


def opened(page: Page) -> Locator:
    """The dialog, opened by keyboard alone."""
    page.get_by_role("button", name="Actions for the batch walk").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Will it flicker?").focus()
    page.keyboard.press("Enter")
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("heading", name="Will walk flicker?")).to_be_visible()
    return dialog


def test_an_even_batch_is_guarded(visit: Visit, farm: NoiseFarm) -> None:
    for frame in (0, 1):
        farm.submit("walk", batch="walk", parameters={"frame": frame}, **STOPS)
    page = visit().page
    dialog = opened(page)
    expect(dialog).to_contain_text("This batch is not guarded")
    expect(dialog).to_contain_text(
        "All its jobs stop alike: by the rule visible at 0.02\u00a0%, not before 200 spp."
    )
    dialog.get_by_role("button", name="Guard it").click()
    expect(dialog).to_contain_text("it takes only jobs that stop as its others do")
    expect(dialog.get_by_role("button", name="Guard it")).to_be_hidden()
    assert Batches(farm.jobs._redis).get("walk").guard.guarded
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_an_uneven_batch_says_who_differs_in_what(
    visit: Visit, farm: NoiseFarm, scheme: str
) -> None:
    made = [
        farm.submit("walk", batch="walk", parameters={"frame": frame}, **{**STOPS, **other})
        for frame, other in enumerate(
            ({}, {}, {"rule": {"name": "visible", "target": 0.01}}, {"max_spp": 100})
        )
    ]
    farm.jobs.cancel(made[1].id)
    page = visit(color_scheme=scheme, bypass_csp=True).page
    dialog = opened(page)
    expect(dialog).to_contain_text("Not all of its jobs stop alike.")
    expect(dialog.get_by_role("listitem")).to_have_text(
        "walk, frame 2: its target is 1\u00a0%, most have 0.02\u00a0%"
    )
    expect(dialog).to_contain_text(
        "1 job ended short of what the rule asks: walk, frame 1. Render them again"
    )
    expect(dialog.get_by_role("button", name="Guard it")).to_be_hidden()
    assert violations(page) == []
    dialog.get_by_role("link", name="walk, frame 2").click()
    expect(page.get_by_role("heading", name="walk")).to_be_visible()
    assert page.url.endswith(made[2].id)


def test_what_changed_meanwhile_is_said(visit: Visit, farm: NoiseFarm) -> None:
    farm.submit("walk", batch="walk", **STOPS)
    page = visit(expected={409}).page
    dialog = opened(page)
    expect(dialog.get_by_role("button", name="Guard it")).to_be_visible()
    farm.submit("walk", batch="walk", **{**STOPS, "step": 50})
    dialog.get_by_role("button", name="Guard it").click()
    expect(dialog.get_by_role("alert")).to_contain_text("its jobs do not stop alike")


def test_what_converged_is_summed_up(visit: Visit, farm: NoiseFarm, client: redis.Redis) -> None:
    jobs = [farm.submit("walk", batch="walk", parameters={"n": n}) for n in (1, 2)]
    for job, spp in zip(jobs, (200, 400), strict=True):
        staged = StagedJob(client, job.id)
        staged.commit(spp // 25)
        staged.point(spp, 3)
        staged.end()
        staged.finish(spp)
    page = visit(expected={404}).page  # the staged jobs have no images
    dialog = opened(page)
    expect(dialog).to_contain_text("did so at 200 to 400 spp, with noise left in 0.025")
    expect(dialog).to_contain_text("The largest change between neighbours: from walk, n 1 with")
