"""Rendering an ended job again: the form has its spec, and its samples are kept if they can be."""

import json
import re
from typing import Any

import httpx
import pytest
import redis
from playwright.sync_api import Page, expect

from plateau.farm.ledger.outbox import Outbox
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.wire.examples import SCENE_XML
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.receiver import SECRET
from tests.support.farms.staged_job import StagedJob
from tests.support.until import until

PARAMETERS = {"width": "64", "height": "48"}


def posted(url: str, scene: str = SCENE_XML, **spec: object) -> dict[str, Any]:
    files = {"scene": ("box.xml", scene), "spec": ("spec.json", json.dumps(spec))}
    return httpx.post(f"{url}/v1/jobs", files=files, timeout=60).json()


def ended(farm: NoiseFarm, url: str, **spec: Any) -> dict[str, Any]:
    """A job that was cancelled before it had begun."""
    job = posted(url, parameters=PARAMETERS, **spec)
    farm.jobs.cancel(job["id"])
    return job


def sent(page: Page, farm: NoiseFarm) -> dict[str, Any]:
    """The spec of the job that the form makes."""
    page.get_by_role("button", name="Render it").click()
    expect(page).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    job = farm.jobs.get(page.url.rpartition("/")[2])
    assert job.state is JobState.QUEUED
    return job.spec.model_dump(mode="json")


def test_a_job_is_rendered_again_with_another_spec(visit: Visit, farm: NoiseFarm, url: str) -> None:
    first = ended(farm, url, name="kitchen", max_spp=400, rule={"name": "fixed", "spp": 300})
    # One that has not ended has no such way
    page = visit(f"/jobs/{farm.submit('box').id}", expected={404, 422}).page
    expect(page.get_by_role("heading", name="box")).to_be_visible()
    expect(page.get_by_role("link", name="Again…")).to_have_count(0)
    page.goto(f"/jobs/{first['id']}")
    page.get_by_role("link", name="Again…").click()
    expect(page).to_have_url(re.compile(rf"/submit\?again={first['id']}$"))
    expect(page.get_by_role("heading", name="Render kitchen again")).to_be_visible()
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    # What cannot be is not sent, and can be mended
    page.get_by_label("Stop at", exact=True).fill("0")
    page.get_by_role("button", name="Render it").click()
    expect(page.get_by_label("Stop at", exact=True)).to_be_focused()
    page.get_by_label("Stop at", exact=True).fill("350")
    page.get_by_label("width", exact=True).fill("32")
    spec = sent(page, farm)
    assert farm.jobs.get(page.url.rpartition("/")[2]).scene_sha256 == first["scene_sha256"]
    expect(page.get_by_text("It renders an earlier job anew: none of its samples")).to_be_visible()
    # Then the new job has what was changed, and all else as it was
    changed = {"rule": {"name": "fixed", "spp": 350}, "parameters": {"width": "32", "height": "48"}}
    assert spec == {**first["spec"], **changed}


@pytest.mark.parametrize(
    "asked",
    [
        {
            "rule": {"name": "reverse", "window": 7, "epsilon": 0.2},
            "watch": [{"name": "visible", "target": 0.05, "min_spp": 100}, {"name": "myszkowski"}],
            "allocation": {"name": "zones", "size": 32},
            "min_spp": 300,
            "time_limit_s": 90.0,
            "time_limit_from": "submission",
        },
        {
            "rule": {"name": "visible", "target": 0.01, "min_spp": 100},
            "denoise": {"name": "oidn", "guides": False},
            "view": {"exposure_ev": 1.5, "white_luminance": 300.0, "pixels_per_degree": 57.0}
            | {"background": [0.2, 0.0, 0.5], "primaries": "adobe1998"},
            "aovs": ["albedo", "depth"],
            "exr": {"precision": "half", "compression": "zip"},
            "batch": "walk",
            "keep_slices": True,
            "priority": -5,
            "variant": "scalar_rgb",
            "pool": "night",
            "requires": ["gpu", "highmem"],
        }
        | {"seed": 12, "sensor": 0, "slice_spp": 50, "step": 200},
    ],
)
def test_what_is_not_changed_is_as_it_was(
    visit: Visit, farm: NoiseFarm, url: str, asked: dict[str, Any]
) -> None:
    first = ended(farm, url, **asked)
    page = visit(f"/submit?again={first['id']}", expected={404}).page
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    spec = sent(page, farm)
    assert spec == first["spec"]


def test_what_is_shown_is_what_is_sent(visit: Visit, farm: NoiseFarm, url: str) -> None:
    # Given a scene that has no default for one of its parameters, and a job that others heard of
    scene = SCENE_XML.replace('  <default name="width" value="256"/>\n', "")
    watch = [{"name": "reverse"}]
    first = ended(farm, url, scene=scene, notice={"targets": ["lead"]}, watch=watch)
    page = visit(f"/submit?again={first['id']}", expected={404}).page
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    for name, value in PARAMETERS.items():
        expect(page.get_by_label(name, exact=True)).to_have_value(value)
    page.get_by_label("Rules to watch").fill("visible")
    spec = sent(page, farm)
    assert (spec["parameters"], spec["notice"]["targets"]) == (PARAMETERS, ["lead"])
    assert [one["name"] for one in spec["watch"]] == ["visible"]
    # As its help says, none is the default
    page.goto(f"/submit?again={first['id']}")
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    page.get_by_label("Rules to watch").fill("")
    assert sent(page, farm)["watch"] == JobSpec().model_dump(mode="json")["watch"]
    # And with frames it is a batch
    page.goto(f"/submit?again={first['id']}")
    page.get_by_text("Frames: a job for each value").click()
    page.get_by_label("Parameter", exact=True).select_option("width")
    for label in ("From", "To, included"):
        page.get_by_label(label, exact=True).fill("64")
    page.get_by_role("button", name="Render it").click()
    expect(page).to_have_url(re.compile(r"/\?batch="))


def test_kept_slices_are_judged_again_under_another_view(
    visit: Visit, farm: NoiseFarm, url: str
) -> None:
    short = {"step": 25, "slice_spp": 25, "max_spp": 50, "parameters": PARAMETERS}
    job = posted(url, **short, keep_slices=True, view={"pixels_per_degree": 57.0})
    with farm.monitor():
        farm.render(2)
        until(lambda: farm.jobs.get(job["id"]).finished_at is not None)
    page = visit(f"/submit?again={job['id']}", expected={404, 422}).page
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    page.get_by_label("Image width seen under").fill("20")
    page.get_by_role("button", name="Render it").click()
    expect(page.get_by_text("It keeps 50 spp of an earlier job.")).to_be_visible()
    new = farm.jobs.get(page.url.rpartition("/")[2])
    assert (new.spec.view.field_of_view_deg, new.spec.view.pixels_per_degree) == (20, 57)
    with farm.monitor():
        until(lambda: farm.jobs.get(new.id).finished_at is not None)
    assert farm.jobs.get(new.id).points
    assert farm.jobs.get(new.id).machine_s == 0


def test_a_notice_s_url_is_left_out_and_the_form_says_so(
    visit: Visit, farm: NoiseFarm, url: str
) -> None:
    first = ended(farm, url, notice={"url": "https://studio.example/hook", "secret": SECRET})
    page = visit(f"/submit?again={first['id']}", expected={404}).page
    expect(page.locator(".found")).to_contain_text("64 × 48 pixels")
    expect(page.get_by_text("The URL of the job's notice is left out")).to_be_visible()
    assert sent(page, farm)["notice"] == {"url": None, "targets": []}


def test_a_notice_that_is_not_delivered_is_said(visit: Visit, client: redis.Redis) -> None:
    job = StagedJob(client, notice={"url": "https://studio.example/hook", "secret": SECRET})
    job.end(JobState.CANCELLED, "not needed")
    job.finish()
    taken = Outbox(client).take(60)
    assert taken is not None
    Outbox(client).settle(taken, "given-up", "the receiver answered 410")
    page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".notes")).to_have_text(
        "The notice to https://studio.example:443 was given up: the receiver answered 410"
    )


KILLED = "the render process was ended by SIGKILL while rendering a pass"


def test_what_workers_died_of_is_said_with_their_log_and_it_is_rendered_again(
    visit: Visit, farm: NoiseFarm, url: str
) -> None:
    # Given a job on whose first slice the renderers of two workers died
    poisoned = posted(url, name="kitchen", max_spp=400, seed=7)["id"]
    queues = [SliceQueue(farm.jobs._redis, name, 60) for name in ("west", "east", "west")]
    with farm.monitor():
        farm.queue = queues[0]
        for number, queue in enumerate(queues):
            farm.queue = queue
            lease = farm.next_lease()
            queue.died(lease, KILLED, 0.2, f"out of memory, try {number}")
    assert farm.jobs.get(poisoned).state is JobState.FAILED
    page = visit(f"/jobs/{poisoned}", expected={404}).page
    reason = page.locator(".reason")
    expect(reason).to_contain_text(
        f"Slice 0 failed 3 times; each time the process that rendered it ended: {KILLED}."
    )
    expect(reason).to_contain_text("too little memory for the scene")
    expect(page.locator(".log pre")).to_have_text([f"out of memory, try {n}" for n in range(3)])
    page.get_by_role("link", name="Again…").click()
    expect(page.locator(".found")).to_contain_text("pixels")
    page.get_by_role("button", name="Render it").click()
    expect(page).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    expect(page.get_by_role("heading", name="kitchen")).to_be_visible()
    old, new = farm.jobs.get(poisoned), farm.jobs.get(page.url.rpartition("/")[2])
    assert (new.state, new.spec, new.scene_sha256) == (JobState.QUEUED, old.spec, old.scene_sha256)


def test_a_scene_at_fault_is_to_be_mended_and_not_tried_again(
    visit: Visit, farm: NoiseFarm
) -> None:
    job = farm.submit("box")
    with farm.monitor():
        farm.queue.fail(farm.next_lease(), "unknown plugin 'spher'", 0.1, "in scene.xml, line 7")
    page = visit(f"/jobs/{job.id}", expected={404}).page
    expect(page.locator(".reason")).to_contain_text("Unknown plugin 'spher'.")
    expect(page.locator(".reason")).to_contain_text("Mend it, and submit it.")
    expect(page.locator(".log pre")).to_have_text("in scene.xml, line 7")
