"""Where the service wants a key, the page asks for it, and sends it with everything."""

import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import redis
from playwright.sync_api import Page, expect

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.states import JobState
from plateau.farm.wire.examples import SCENE_XML
from plateau.service.api.access.key_guard import Access
from tests.page.conftest import Visit
from tests.support.farms.ledger_farm import about, live_on
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until


@pytest.fixture
def url(redis_url: str, farm: NoiseFarm) -> Iterator[str]:
    with live_api(redis_url, farm.store, access=Access.KEYS) as url:
        yield url


def give(page: Page, key: str) -> None:
    page.get_by_label("API key").fill(key)
    page.keyboard.press("Enter")


def test_it_is_asked_for_once_and_opens_everything(
    visit: Visit, farm: NoiseFarm, keys: ApiKeys, tmp_path: Path
) -> None:
    _, key = keys.create("page", Role.SUBMITTER, KeyLimits())
    job = farm.submit("box", step=25, max_spp=50, rule={"name": "fixed", "spp": 50})
    with farm.monitor():
        farm.render(2)
        until(lambda: farm.jobs.get(job.id).finished_at is not None)
    visitor = visit(f"/jobs/{job.id}", expected={401})
    page = visitor.page
    dialog = page.get_by_role("dialog")
    expect(dialog).to_be_visible()
    expect(page.get_by_label("API key")).to_be_focused()
    # A wrong one is said to be wrong
    give(page, "plateau_wrong")
    expect(dialog).to_contain_text("does not know this key")
    give(page, key)
    expect(dialog).to_have_count(0)
    # JSON, pictures and events come with it
    expect(page.locator(".frame img.layer").first).to_have_js_property("naturalWidth", 32)
    expect(page.locator(".story")).to_contain_text("Its results are written.")
    with page.expect_download() as download:
        page.locator(".files").get_by_role("link", name=re.compile("^PNG")).click()
    assert download.value.path().read_bytes() == farm.picture(job, "image.png")
    # So does an upload, and the next screen asks no more
    (tmp_path / "sphere.xml").write_text(SCENE_XML)
    page.goto("/submit")
    page.set_input_files("#scene-file", tmp_path / "sphere.xml")
    page.get_by_role("button", name="Render it").click()
    expect(page.get_by_role("heading", name="sphere")).to_be_visible()
    # Until it is forgotten
    page.get_by_role("button", name="Forget the key").click()
    expect(page.get_by_role("dialog")).to_be_visible()


def test_a_viewer_is_offered_what_it_may(
    visit: Visit, farm: NoiseFarm, keys: ApiKeys, client: redis.Redis
) -> None:
    _, key = keys.create("guest", Role.VIEWER, KeyLimits())
    job = farm.submit("box")
    visitor = visit("/submit", expected={401, 404})
    page = visitor.page
    # The page itself needs none
    expect(page.get_by_role("heading", name="Submit a scene")).to_be_visible()
    give(page, key)
    page.get_by_role("link", name="Jobs", exact=True).click()
    expect(page.get_by_role("link", name="Submit a scene")).to_be_hidden()
    expect(page.get_by_role("link", name="box", exact=True)).to_be_visible()
    expect(page.get_by_role("checkbox")).to_have_count(0)  # to select jobs by
    page.goto(f"/jobs/{job.id}")
    expect(page.get_by_role("heading", name="box")).to_be_visible()
    expect(page.get_by_role("button", name="Cancel")).to_have_count(0)
    expect(page.get_by_label("Priority")).to_be_hidden()
    # An ended one cannot be made again by it, nor one that failed
    farm.jobs.cancel(job.id)
    expect(page.locator(".title .state")).to_have_text("cancelled")
    expect(page.get_by_role("link", name="Again…")).to_have_count(0)
    failed = StagedJob(client)
    failed.end(JobState.FAILED, "slice 0 failed 3 times: SIGKILL", "deaths")
    page.goto(f"/jobs/{failed.id}")
    expect(page.locator(".reason")).to_contain_text("The renderer died.")
    expect(page.get_by_role("link", name="Again…")).to_have_count(0)
    # The form is not shown, whatever leads to it
    for path in ("/submit", f"/submit?again={job.id}"):
        page.goto(path)
        expect(page.get_by_text("This key may look at jobs, and submit none.")).to_be_visible()
        expect(page.locator("form")).to_have_count(0)
    # Workers are looked at
    page.goto("/workers")
    SliceQueue(client, "w-1", 3600).heartbeat({**about("w-1"), "job": job.id, "slice": 3}, ())
    live_on(client, "w-1")
    expect(page.locator('[data-worker="w-1"]')).to_be_visible()
    expect(page.locator("main").get_by_role("button")).to_have_count(0)


def test_a_submitter_steers_its_own_jobs(
    visit: Visit, farm: NoiseFarm, keys: ApiKeys, url: str
) -> None:
    _, key = keys.create("anna", Role.SUBMITTER, KeyLimits())
    farm.submit("other")
    files = {"scene": ("mine.xml", SCENE_XML)}
    headers = {"Authorization": f"Bearer {key}"}
    answer = httpx.post(f"{url}/v1/jobs", files=files, headers=headers, trust_env=False, timeout=60)
    assert answer.status_code == 201
    who = httpx.get(f"{url}/v1/key", headers=headers, trust_env=False, timeout=60).json()
    assert (who["name"], who["role"]) == ("anna", "submitter")
    visitor = visit(expected={401})
    page = visitor.page
    give(page, key)
    expect(page.locator(".job", has_text="mine")).to_contain_text("by anna")
    page.get_by_role("checkbox").check()  # there is none of the other's
    expect(page.get_by_text("1 job selected")).to_be_visible()
    expect(page.get_by_role("button", name="Cancel…")).to_be_visible()
