"""The screen of a job that failed says why, what to do, and what was printed."""

import json
import re

import httpx
import pytest
from playwright.sync_api import Locator, Page, expect

from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.states import JobState
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.scenes.bundles import scene

A_JOB = re.compile("/jobs/[0-9a-f]{12}$")
KILLED = "the render process was ended by SIGKILL while rendering a pass"


def why(page: Page) -> Locator:
    return page.get_by_role("region", name="Why it failed")


@pytest.fixture
def poisoned(farm: NoiseFarm, url: str) -> str:
    """A job on whose first slice the renderers of two workers died."""
    asked = {"name": "kitchen", "max_spp": 400, "seed": 7}
    files = {"scene": ("box.xml", scene()), "spec": ("spec.json", json.dumps(asked))}
    job_id: str = httpx.post(f"{url}/v1/jobs", files=files, timeout=60).json()["id"]
    queues = [SliceQueue(farm.jobs._redis, name, 60) for name in ("west", "east", "west")]
    with farm.monitor():
        farm.queue = queues[0]
        for number, queue in enumerate(queues):
            farm.queue = queue
            lease = farm.next_lease()
            queue.died(lease, KILLED, 0.2, f"out of memory, try {number}")
    assert farm.jobs.get(job_id).state is JobState.FAILED
    return job_id


def test_what_workers_died_of_is_said_with_their_log_and_it_is_rendered_again(
    visit: Visit, farm: NoiseFarm, poisoned: str
) -> None:
    page = visit(f"/jobs/{poisoned}", expected={404}).page
    expect(page.locator(".reason")).to_have_text(
        f"Slice 0 failed 3 times; each time the process that rendered it ended: {KILLED}."
    )
    expect(why(page)).to_contain_text("too little memory for the scene")
    expect(why(page)).to_contain_text("Slice 0 was tried 3 times, by 2 workers.")
    expect(why(page).locator("pre")).to_have_text([f"out of memory, try {n}" for n in range(3)])
    page.get_by_role("link", name="Again…").click()
    expect(page.locator(".found")).to_contain_text("pixels")
    page.get_by_role("button", name="Render it").click()
    expect(page).to_have_url(A_JOB)
    expect(page.get_by_role("heading", name="kitchen")).to_be_visible()
    expect(why(page)).to_have_count(0)
    old, new = farm.jobs.get(poisoned), farm.jobs.get(page.url.rpartition("/")[2])
    assert (new.state, new.spec, new.scene_sha256) == (JobState.QUEUED, old.spec, old.scene_sha256)


def test_a_scene_at_fault_is_to_be_mended_and_not_tried_again(
    visit: Visit, farm: NoiseFarm
) -> None:
    job = farm.submit("box")
    with farm.monitor():
        farm.queue.fail(farm.next_lease(), "unknown plugin 'spher'", 0.1, "in scene.xml, line 7")
    page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".reason")).to_have_text("Unknown plugin 'spher'.")
    expect(why(page)).to_contain_text("Mend it, and submit it.")
    expect(why(page).locator("pre")).to_have_text("in scene.xml, line 7")
    expect(why(page).get_by_role("button")).to_have_count(0)
