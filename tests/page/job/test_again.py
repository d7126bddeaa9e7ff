"""Submitting the scene of an ended job again, from the job's screen."""

import json
import re

import httpx
from playwright.sync_api import expect

from plateau.farm.model.states import JobState
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.scenes.bundles import scene


def test_a_scene_is_submitted_again_with_another_spec(
    visit: Visit, farm: NoiseFarm, url: str
) -> None:
    # Given a job that was cancelled before it had begun
    asked = {"name": "kitchen", "max_spp": 400, "rule": {"name": "fixed", "spp": 300}, "seed": 7}
    files = {"scene": ("box.xml", scene()), "spec": ("spec.json", json.dumps(asked))}
    first = httpx.post(f"{url}/v1/jobs", files=files, timeout=60).json()
    farm.jobs.cancel(first["id"])
    page = visit(f"/jobs/{first['id']}", expected={404, 422}).page
    page.get_by_role("button", name="Submit again…").click()
    dialog = page.get_by_role("dialog")
    spec = dialog.get_by_label("The spec, as JSON")
    had = json.loads(spec.input_value())
    assert {name: had[name] for name in ("name", "max_spp", "seed")} == {
        "name": "kitchen",
        "max_spp": 400,
        "seed": 7,
    }
    # What cannot be is said by the service, and can be mended
    spec.fill('{"max_spp": 400')
    dialog.get_by_role("button", name="Submit it").click()
    expect(dialog.get_by_role("alert")).to_contain_text("JSON")
    spec.fill(json.dumps({**had, "max_spp": 800}))
    dialog.get_by_role("button", name="Submit it").click()
    # Then there is another job of the same scene
    expect(page).not_to_have_url(re.compile(f"{first['id']}$"))
    expect(page.get_by_role("heading", name="kitchen")).to_be_visible()
    new = farm.jobs.get(page.url.rpartition("/")[2])
    assert new.scene_sha256 == first["scene_sha256"]
    assert (new.spec.max_spp, new.spec.seed, new.spec.rule.spp) == (800, 7, 300)
    assert new.state is JobState.QUEUED


def test_a_job_that_has_not_ended_has_no_such_button(visit: Visit, farm: NoiseFarm) -> None:
    page = visit(f"/jobs/{farm.submit('box').id}").page
    expect(page.get_by_role("heading", name="box")).to_be_visible()
    expect(page.get_by_role("button", name="Submit again…")).to_have_count(0)
