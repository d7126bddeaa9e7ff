"""The workers' screen."""

import redis
from playwright.sync_api import expect

from farm.queue import SliceQueue
from tests.farm.test_workers import about
from tests.page.conftest import Visit
from tests.support.noise_farm import NoiseFarm


def test_each_worker_says_what_it_does(visit: Visit, farm: NoiseFarm, client: redis.Redis) -> None:
    page = visit("/workers").page
    expect(page.get_by_text("Nobody renders.")).to_be_visible()
    job = farm.submit("box.zip")
    busy = {**about("w-1"), "job": job.id, "slice": 3, "samples_per_s": 2.5e6}
    SliceQueue(client, "w-1", 60).heartbeat(busy, ())
    error = {"last_error": "slice 2: <b>SIGSEGV</b>"}
    SliceQueue(client, "w-2", 60).heartbeat({**about("w-2"), **error}, ())
    first, second = page.locator('[data-worker="w-1"]'), page.locator('[data-worker="w-2"]')
    expect(first).to_contain_text("box, slice 3")
    expect(first).to_contain_text("2.5 M")
    expect(second).to_contain_text("idle")
    expect(second).to_contain_text("Last error: slice 2: <b>SIGSEGV</b>")
    expect(page.locator(".summary").first).to_contain_text("2 workers · 1 rendering")
    # One is drained, and let work again
    page.get_by_role("button", name="Drain w-2").click()
    page.get_by_role("button", name="Drain it").click()
    expect(second).to_contain_text("drained: it may be stopped")
    assert [one.drained for one in sorted(farm.jobs.workers(), key=lambda one: one.id)] == [
        False,
        True,
    ]
    page.get_by_role("button", name="Let it work: w-2").click()
    expect(second).to_contain_text("idle")
    # And what each renders is one step away
    first.get_by_role("link", name="box").click()
    expect(page.get_by_role("heading", name="box")).to_be_visible()
