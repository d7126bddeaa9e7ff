"""The page on a real farm: API, monitor and worker in processes of their own, and Mitsuba."""

import re
import shutil
from pathlib import Path

import pytest
from playwright.sync_api import expect

from plateau.files.packing import pack
from tests.page.conftest import Visit
from tests.support.farms.real_farm import BOX, RealFarm


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene that says how many samples it wants, which the farm takes no notice of."""
    path = tmp_path / "box.zip"
    copied = shutil.copytree(BOX, tmp_path / "box") / "scene.xml"
    wants = '<sampler type="independent"><integer name="sample_count" value="16"/></sampler>'
    copied.write_text(copied.read_text().replace('<sampler type="independent"/>', wants))
    with pack(copied) as packed:
        path.write_bytes(packed.file.read())
    return path


def test_a_scene_is_submitted_and_rendered_to_its_end(
    visit: Visit, tmp_path: Path, cache: Path, scene: Path
) -> None:
    with RealFarm(tmp_path / "farm", cache) as farm:
        farm.start("monitor")
        farm.workers(1)
        visitor = visit(
            "/submit", url=farm.url, expected={404}
        )  # its first picture comes a moment after its first point
        page = visitor.page
        page.set_input_files("#scene-file", scene)
        for name, value in (("width", "48"), ("height", "32")):
            page.get_by_label(name, exact=True).fill(value)
        page.get_by_text("Other rules", exact=True).click()
        page.get_by_role("radio", name="A number of samples").check()
        page.get_by_label("Stop at", exact=True).fill("50")
        page.get_by_label("Judge every").fill("25")
        page.get_by_role("button", name="Render it").click()
        expect(page).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
        expect(page.locator(".one-job .title .state")).to_have_text("converged", timeout=120_000)
        expect(page.locator(".frame img.layer").first).to_have_js_property("naturalWidth", 48)
        # And what the scene asked for in vain is told
        expect(page.locator(".notes")).to_contain_text("sample_count of 16 was ignored")
        page.goto("/workers")
        expect(page.locator(".worker")).to_contain_text("idle")
        visitor.leave()
