"""The workers' screen."""

import socket
from datetime import datetime, timezone

import redis
from playwright.sync_api import expect

from plateau.farm.ledger.members import note_refused
from plateau.farm.ledger.outbox import Outbox
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.errors import Refused
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.farm.ledger.test_workers import about
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob

#: Of its lease: no worker of these goes away, however slow the test is.
HOUR = 3600

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
    job = farm.submit("box.zip")
    place = {"pool": "night", "tags": ["gpu", "highmem"]}
    busy = {**about("w-1"), **place, "job": job.id, "slice": 3, "samples_per_s": 2.5e6}
    done = {"job": job.id, "slice": 2, "spp": 25, "render_s": 0.61}
    busy |= {"machine": MACHINE, "core_hours": 0.25, "last_slices": [done]}
    busy["kinds"] = ["mitsuba 3.9.1 (llvm_ad_rgb; a processor; bits 3f1c09ab27de)"]
    SliceQueue(client, "w-1", HOUR).heartbeat(busy, ())
    error = {"last_error": "slice 2: <b>SIGSEGV</b>"}
    SliceQueue(client, "w-2", HOUR).heartbeat({**about("w-2"), **error}, ())
    first, second = page.locator('[data-worker="w-1"]'), page.locator('[data-worker="w-2"]')
    expect(first).to_contain_text("box, slice 3")
    expect(first).to_contain_text("2.5 M")
    expect(first).to_contain_text("pool night · tags gpu, highmem")
    # Its machine and its last slices, if it says them
    expect(first.locator(".machine")).to_have_text(
        "93.4 % of 8 cores in use · 8.5 GB of 31.3 GB memory · 774 MB of disk left · 71 °C"
        " · 0.25 core hours rendered"
    )
    first.get_by_text("Last slices").click()
    expect(first.get_by_role("listitem")).to_have_text("box, slice 2: 25 spp in 0.6 s")
    expect(second.locator(".machine")).to_be_hidden()
    expect(second.get_by_text("Last slices")).to_be_hidden()
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
    first.get_by_text("What its bits depend on").click()
    expect(first).to_contain_text("bits 3f1c09ab27de")
    # One on which a slice died is left out of the job
    client.hset(keys.worker("w-1"), "left_out", f"{job.id} 9000000000000")
    expect(first.locator(".left-out")).to_have_text("Left out for a while of box")
    after = farm.submit("comp", after=(job.id,))
    waiting = visit(f"/jobs/{after.id}", expected={404}).page
    expect(waiting.locator(".reason")).to_have_text(f"It waits for job box.zip ({job.id}).")
    # What a job's command has come to is in its story, though its stream has ended
    done = StagedJob(client, then=["movie"])
    done.commit(4)
    done.point(100, visible=3)
    done.end(JobState.CONVERGED, "levelled off")
    done.finish()
    taken = Outbox(client).take(60)
    assert taken is not None
    Outbox(client).settle(taken, "given-up", status=3, error="no", took_s=1.0, words="no codec")
    finished = visit(f"/jobs/{done.id}", expected={404}).page
    expect(finished.locator(".story")).to_contain_text(
        "The command movie ended with exit code 3: no codec"
    )
    # And what each renders is one step away
    first.get_by_role("link", name="box").first.click()
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
    SliceQueue(client, "w-1", HOUR).heartbeat({**about("w-1"), **start, "plateau": "0.4.0"}, ())
    expect(told).to_have_count(0)
    expect(page.locator('[data-worker="w-1"]')).to_contain_text("Plateau 0.4.0")
