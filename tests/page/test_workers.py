"""The workers' screen."""

import redis
from playwright.sync_api import expect

from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.workers import Workers
from plateau.farm.redis import keys
from tests.page.conftest import Visit
from tests.support.farms.ledger_farm import about, live_on
from tests.support.farms.noise_farm import NoiseFarm

MACHINE = {
    "cores": 8,
    "load": 0.934,
    "memory_bytes": 33_567_264_768,
    "memory_used_bytes": 9_123_528_704,
    "disk_bytes": 250e9,
    "disk_free_bytes": 812e6,
    "temperature_c": 71.4,
}


def test_each_worker_says_what_it_does(visit: Visit, farm: NoiseFarm, client: redis.Redis) -> None:
    page = visit("/workers").page
    expect(page.get_by_text("There are no workers.")).to_be_visible()
    job = farm.submit("box")
    place = {"pool": "night", "tags": ["gpu", "highmem"]}
    busy = {**about("w-1"), **place, "job": job.id, "slice": 3, "samples_per_s": 2.5e6}
    busy |= {"machine": MACHINE, "core_hours": 0.25}
    SliceQueue(client, "w-1", 60).heartbeat(busy, ())
    error = {"last_error": "slice 2: <b>SIGSEGV</b>"}
    SliceQueue(client, "w-2", 60).heartbeat({**about("w-2"), **error}, ())
    live_on(client, "w-1", "w-2")
    first, second = page.locator('[data-worker="w-1"]'), page.locator('[data-worker="w-2"]')
    expect(first).to_contain_text("box, slice 3")
    expect(first).to_contain_text("2.5 M")
    expect(first).to_contain_text("pool night · tags gpu, highmem")
    # Its machine, if it says it
    expect(first.locator(".machine")).to_have_text(
        "93.4 % of 8 cores in use · 9.12 GB of 33.6 GB memory · 812 MB of disk left · 71 °C"
        " · 0.25 core hours rendered"
    )
    expect(second).not_to_contain_text("pool")
    expect(second.locator(".machine")).to_be_hidden()
    expect(second).to_contain_text("idle")
    expect(second).to_contain_text("Last error: slice 2: <b>SIGSEGV</b>")
    expect(page.locator(".summary").first).to_contain_text("2 workers · 1 rendering")
    # One is drained, and let work again
    page.get_by_role("button", name="Drain w-2").click()
    page.get_by_role("button", name="Drain it").click()
    expect(second).to_contain_text("drained: it may be stopped")
    assert [one.id for one in Workers(farm.client).living() if one.drained] == ["w-2"]
    page.get_by_role("button", name="Resume w-2").click()
    expect(second).to_contain_text("idle")
    # One on which a slice died is left out of the job
    client.hset(keys.worker("w-1"), "left_out", f"{job.id} 9000000000000")
    expect(first.locator(".left-out")).to_have_text("Left out for a while of box")
    after = farm.submit("comp", after=(job.id,))
    waiting = visit(f"/jobs/{after.id}", expected={404}).page
    expect(waiting.locator(".reason")).to_have_text(f"It waits for job box ({job.id}).")
    # And what each renders is one step away
    first.get_by_role("link", name="box").first.click()
    expect(page.get_by_role("heading", name="box")).to_be_visible()
