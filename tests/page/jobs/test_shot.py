"""A batch that is a shot: how good it is in motion, its frames, and its film."""

from playwright.sync_api import expect

from plateau.farm.model.spec import BatchSpec
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.processes.browser import violations

SHOT = {
    "shot": {"fps": 24, "target": None},
    "rule": {"name": "fixed", "spp": 40},
    "step": 20,
    "slice_spp": 10,
    "parameters": [{"frame": place} for place in range(3)],
}


def test_a_shot_is_looked_at_from_its_first_frame_to_its_judgement(
    visit: Visit, farm: NoiseFarm
) -> None:
    specs = BatchSpec.model_validate(SHOT).job_specs("walk")
    farm.jobs.create(*specs, name="walk", scene_sha256="00")
    page = visit(expected={404}).page  # pictures are replaced while the film is made
    page.get_by_role("button", name="Look at the shot").click()
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("3 frames at 24 per second. Its frames are being rendered")
    frames = dialog.get_by_role("group", name="Its frames, in their order").get_by_role("link")
    expect(frames).to_have_count(3)
    jobs = farm.jobs.search(batch="walk")[0][::-1]
    with farm.monitor():
        farm.work(lambda: all(farm.is_finished(job) for job in jobs))
    expect(dialog).to_contain_text("It was judged.")
    expect(dialog).to_contain_text("In motion it has an estimated")
    expect(dialog.get_by_role("img", name="The film of its newest images")).to_be_visible()
    expect(dialog.get_by_role("img", name="Where noise is seen in motion")).to_be_visible()
    assert "frame 1: 40 spp, " in (frames.nth(1).get_attribute("aria-label") or "")
    assert violations(page) == []
    frames.nth(1).click()
    expect(page.get_by_role("heading", name="walk")).to_be_visible()
    assert page.url.endswith(jobs[1].id)
