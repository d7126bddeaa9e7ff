"""A real farm with a stopping rule from an installed distribution: API, command line and page."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect

from plateau.files.packing import pack
from tests.page.conftest import Visit
from tests.support.farms.real_farm import BOX, RealFarm

TOY = Path(__file__).parents[1] / "support" / "toy_rule"


@pytest.fixture(scope="module")
def toy_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("toy"), cache, plain=True, PYTHONPATH=str(TOY)) as farm:
        yield farm


def plateau(farm: RealFarm, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "plateau", *arguments],
        env=farm.environment,
        capture_output=True,
        text=True,
    )


def test_the_api_describes_it(toy_farm: RealFarm) -> None:
    with httpx.Client(base_url=toy_farm.url, verify=False, trust_env=False, timeout=60) as http:
        schemas = http.get("/openapi.json").json()["components"]["schemas"]
        rules = http.get("/v1/rules").json()["rules"]
    assert schemas["ToySpec"]["description"] == "Stops when the image was looked at often enough."
    looks = schemas["ToySpec"]["properties"]["looks"]
    assert (looks["default"], looks["minimum"], looks["maximum"]) == (5, 1, 1000)
    told, *_ = schemas["JobSpec"]["properties"]["rule"]["anyOf"]
    assert told["discriminator"]["mapping"]["toy"] == "#/components/schemas/ToySpec"
    assert [rule["name"] for rule in rules][-1] == "toy"


def test_the_command_line_helps_with_it(toy_farm: RealFarm) -> None:
    said = " ".join(plateau(toy_farm, "render", "--help").stdout.split())
    assert "psnr, noise and toy." in said
    assert "--looks alone means toy." in said
    assert "toy: evaluations after which to stop. [default: (5)]" in said
    # Its bounds hold there, too
    refused = plateau(toy_farm, "submit", "scenes:box", "--looks", "1001", "--url", toy_farm.url)
    assert (refused.returncode, "--looks: must be at most 1,000" in refused.stderr) == (2, True)


def test_a_job_is_judged_by_it_and_the_page_offers_it(
    toy_farm: RealFarm, visit: Visit, tmp_path: Path
) -> None:
    # Given a scene that says how many samples it wants, which the farm takes no notice of
    copied = shutil.copytree(BOX, tmp_path / "box") / "scene.xml"
    wants = '<sampler type="independent"><integer name="sample_count" value="16"/></sampler>'
    copied.write_text(copied.read_text().replace('<sampler type="independent"/>', wants))
    with pack(copied) as packed:
        (tmp_path / "box.zip").write_bytes(packed.file.read())
    toy_farm.start("monitor")
    toy_farm.workers(1)
    # The first picture comes a moment after the first point
    visitor = visit("/submit", url=toy_farm.url, expected={404, 503})
    page = visitor.page
    page.set_input_files("#scene-file", tmp_path / "box.zip")
    for name in ("width", "height"):
        page.get_by_label(name, exact=True).fill("32")
    page.get_by_text("Others", exact=True).click()
    page.get_by_role("radio", name="A number of looks").check()
    looks = page.get_by_label("Looks", exact=True)
    expect(looks).to_have_value("5")
    expect(looks).to_have_attribute("max", "1000")
    looks.fill("3")
    page.get_by_label("Judge every").fill("25")
    page.get_by_role("button", name="Render it").click()
    expect(page).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    expect(page.locator(".one-job .title .state")).to_have_text("converged", timeout=250_000)
    said = "It stopped by itself at 75 spp: looked 3 times, at 75 spp."
    expect(page.locator(".reason")).to_have_text(said)
    path = page.url.replace("/jobs/", "/v1/jobs/")
    job = httpx.get(path, verify=False, trust_env=False, timeout=60).json()
    assert job["spec"]["rule"] == {"name": "toy", "looks": 3}
    assert job["reason"] == "looked 3 times, at 75 spp"
    expect(page.locator(".frame img.layer").first).to_have_js_property("naturalWidth", 32)
    # And what the scene asked for in vain is told
    expect(page.locator(".notes")).to_contain_text("sample_count of 16 was ignored")
    page.goto("/workers")
    expect(page.locator(".worker")).to_contain_text("idle")
    visitor.leave()
