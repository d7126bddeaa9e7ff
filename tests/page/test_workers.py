"""The workers' screen."""

import socket
from datetime import datetime, timezone

import redis
from playwright.sync_api import expect

from plateau.farm.ledger.members import note_refused
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.errors import Refused
from tests.farm.ledger.test_workers import about
from tests.page.conftest import Visit
from tests.support.noise_farm import NoiseFarm


def test_each_worker_says_what_it_does(visit: Visit, farm: NoiseFarm, client: redis.Redis) -> None:
    page = visit("/workers").page
    expect(page.get_by_text("There are no workers.")).to_be_visible()
    job = farm.submit("box.zip")
    place = {"pool": "night", "tags": ["gpu", "highmem"]}
    busy = {**about("w-1"), **place, "job": job.id, "slice": 3, "samples_per_s": 2.5e6}
    SliceQueue(client, "w-1", 60).heartbeat(busy, ())
    error = {"last_error": "slice 2: <b>SIGSEGV</b>"}
    SliceQueue(client, "w-2", 60).heartbeat({**about("w-2"), **error}, ())
    first, second = page.locator('[data-worker="w-1"]'), page.locator('[data-worker="w-2"]')
    expect(first).to_contain_text("box, slice 3")
    expect(first).to_contain_text("2.5 M")
    expect(first).to_contain_text("pool night · tags gpu, highmem")
    expect(second).not_to_contain_text("pool")
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
    page.get_by_role("button", name="Resume w-2").click()
    expect(second).to_contain_text("idle")
    # And what each renders is one step away
    first.get_by_role("link", name="box").click()
    expect(page.get_by_role("heading", name="box")).to_be_visible()


def test_who_was_refused_is_told_of(visit: Visit, farm: NoiseFarm, client: redis.Redis) -> None:
    note_refused(client, "worker", Refused(3, 4, "0.4.0"))
    page = visit("/workers").page
    told = page.get_by_role("list", name="Refused").get_by_role("listitem")
    expect(told).to_have_count(1)
    expect(told).to_contain_text("was refused just now: the farm's monitors and APIs speak")
    expect(told).to_contain_text("It is too old: install Plateau 0.4.0 here")
    # Until a worker of that machine is let in
    start = {"host": socket.gethostname(), "started_at": datetime.now(timezone.utc).isoformat()}
    SliceQueue(client, "w-1", 60).heartbeat({**about("w-1"), **start, "plateau": "0.4.0"}, ())
    expect(told).to_have_count(0)
    expect(page.locator('[data-worker="w-1"]')).to_contain_text("Plateau 0.4.0")
