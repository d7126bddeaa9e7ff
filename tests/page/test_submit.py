"""Submitting a scene by the page: what was found in it, what is refused, and where it leads."""

import re
import zipfile
from pathlib import Path
from typing import get_args

import pytest
from playwright.sync_api import Page, expect
from pydantic import BaseModel

from plateau.farm.model.aovs import AOV_NAMES
from plateau.farm.model.spec import PLACES, ExrSpec, JobSpec, RuleSpec, ViewSpec
from plateau.farm.model.spec.parts import ZonesAllocation
from plateau.farm.wire.examples import SCENE_XML
from tests.page.conftest import Visit
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.scenes.mistakes import IN_A_FILE, mistaken

DROP = """(place, text) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([text], "dropped.xml", { type: "text/xml" }));
  const how = { dataTransfer, bubbles: true, cancelable: true };
  place.dispatchEvent(new DragEvent("drop", how));
}"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "sphere.xml"
    path.write_text(SCENE_XML)
    return path


def opened(page: Page) -> Page:
    """The form, once it is there: it comes after the service's rules."""
    expect(page.locator("#scene-file")).to_be_attached()
    return page


@pytest.fixture
def form(visit: Visit) -> Page:
    return opened(visit("/submit").page)


def choose(form: Page, scene: Path) -> None:
    form.set_input_files("#scene-file", scene)


def test_a_scene_is_looked_at_and_rendered(form: Page, farm: NoiseFarm, scene: Path) -> None:
    expect(form.get_by_role("button", name="Render it")).to_be_hidden()
    choose(form, scene)
    # What was found in it
    expect(form.locator(".found")).to_contain_text("sphere.xml")
    expect(form.locator(".found")).to_contain_text("256 × 256 pixels")
    # A parameter that is changed is taken into account at once
    form.get_by_label("width", exact=True).fill("64")
    form.get_by_label("height", exact=True).fill("48")
    form.get_by_label("height", exact=True).blur()
    expect(form.locator(".found")).to_contain_text("64 × 48 pixels")
    form.get_by_label("At most").fill("2000")
    form.get_by_role("radio", name="No noise left to see").check()
    form.get_by_label("Noise that may be left").fill("0.1")
    form.get_by_label("Time limit").fill("2")
    form.get_by_text("More", exact=True).click()
    form.get_by_label("Batch").fill("evening")
    form.get_by_role("button", name="Render it").click()
    expect(form).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    expect(form.get_by_role("heading", name="sphere")).to_be_visible()
    job = farm.jobs.get(form.url.rpartition("/")[2])
    assert job.name == "sphere"
    assert job.spec.rule.model_dump() == {"name": "visible", "target": 0.001, "min_spp": 200}
    assert job.spec.parameters == {"width": "64", "height": "48"}
    assert (job.spec.max_spp, job.spec.time_limit_s, job.spec.batch) == (2000, 120, "evening")


def rendered(form: Page, farm: NoiseFarm) -> JobSpec:
    """The spec of the job that the form makes."""
    form.get_by_role("button", name="Render it").click()
    expect(form).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    return farm.jobs.get(form.url.rpartition("/")[2]).spec


def test_another_rule_zones_and_denoising(form: Page, farm: NoiseFarm, scene: Path) -> None:
    choose(form, scene)
    # Presets set the rule
    form.get_by_role("button", name="To the eye's limit").click()
    expect(form.get_by_role("radio", name="ColorVideoVDP")).to_be_checked()
    expect(form.get_by_label("By itself")).to_be_checked()
    for preset, quality in (("Draft", "9"), ("Final", "9.5")):
        form.get_by_role("button", name=preset).click()
        expect(form.get_by_label("Quality to reach")).to_have_value(quality)
    form.get_by_role("button", name="The paper As").click()
    expect(form.get_by_label("Or image width seen under")).to_have_value("45")
    form.get_by_label("Slope to stop at").fill("0.5")
    expect(form.get_by_role("radio", name="All over the frame Every")).to_be_checked()
    size, guides = form.get_by_label("Side of a zone"), form.get_by_label("With guides")
    expect(size).to_be_hidden()
    form.get_by_label("To the zones that need them").check()
    size.fill("64")
    expect(guides).to_be_hidden()
    form.get_by_label("By Open Image Denoise").check()
    guides.uncheck()
    form.get_by_role("button", name="in a cinema").click()
    expect(form.get_by_label("Pixels in a degree")).to_have_value("57")
    form.get_by_label("Display white").fill("60")
    spec = rendered(form, farm)
    assert spec.rule.model_dump() == {"name": "reverse", "window": 5, "epsilon": 0.5}
    assert spec.allocation.model_dump() == {"name": "zones", "size": 64}
    assert spec.denoise.model_dump() == {"name": "oidn", "guides": False}
    assert spec.view == ViewSpec.model_validate({**PLACES["cinema"], "white_luminance": 60})


def test_all_of_a_spec_can_be_asked_for(form: Page, farm: NoiseFarm, scene: Path) -> None:
    choose(form, scene)
    form.get_by_label("Primaries").select_option("adobe1998")
    form.get_by_label("Which begins at").select_option(label="the submission")
    form.get_by_text("More", exact=True).click()
    for label, text in (
        ("Name", "dusk, last take"),
        ("Pool", "night"),
        ("Tags", "highmem, fast"),
        ("URL", "https://studio.example/hooks/plateau"),
        ("Its secret", "whsec_" + "A" * 32),
        ("Batch", "walk"),
        ("No sooner than", "400"),
        ("Background", "0.5, 0, 1"),
        ("Channels of image.exr", "albedo, shape_id"),
        ("Rules to watch", "reverse, visible"),
        ("Notify", "lead"),
    ):
        form.get_by_label(label, exact=True).fill(text)
    expect(form.get_by_text("Of lead, ops, separated by commas.")).to_be_visible()
    form.get_by_label("Keep every slice").check()
    form.get_by_label("Precision of image.exr").select_option("half")
    form.get_by_label("Its compression").select_option("piz")
    form.get_by_label("Variant").select_option("scalar_rgb")
    spec = rendered(form, farm)
    assert (spec.batch, spec.min_spp, spec.keep_slices) == ("walk", 400, True)
    assert (spec.aovs, spec.view.background) == (("albedo", "shape_id"), (0.5, 0, 1))
    assert (spec.exr.precision, spec.exr.compression) == ("half", "piz")
    assert (spec.name, spec.pool, spec.variant) == ("dusk, last take", "night", "scalar_rgb")
    assert set(spec.requires) == {"highmem", "fast"}
    assert spec.notice.targets == ("lead",)
    assert [rule.name for rule in spec.watch] == ["reverse", "visible"]
    assert (spec.view.primaries, spec.time_limit_from) == ("adobe1998", "submission")
    assert spec.notice.url == "https://studio.example/hooks/plateau"


def test_frames_are_one_batch(form: Page, farm: NoiseFarm, scene: Path) -> None:
    choose(form, scene)
    form.get_by_text("Frames: a job for each value").click()
    form.get_by_label("Parameter", exact=True).select_option("width")
    form.get_by_role("button", name="Render it").click()
    expect(form.get_by_text("Say where the values begin and end")).to_be_visible()
    form.get_by_label("From", exact=True).fill("1")
    form.get_by_label("To, included", exact=True).fill("1700000000")
    expect(form.get_by_text("at most 1000 of them")).to_be_visible()
    for label, value in (("From", "32"), ("To, included", "64"), ("In steps of", "16")):
        form.get_by_label(label, exact=True).fill(value)
    expect(form.get_by_text("3 jobs, in one batch.")).to_be_visible()
    form.get_by_text("More", exact=True).click()
    form.get_by_label("Batch").fill("growing")
    form.get_by_role("button", name="Render it").click()
    expect(form).to_have_url(re.compile(r"/\?batch=growing$"))
    jobs, _ = farm.jobs.search(batch="growing", limit=10)
    assert sorted(int(job.spec.parameters["width"]) for job in jobs) == [32, 48, 64]


def test_a_scene_is_dropped_edited_and_brought_again(
    form: Page, scene: Path, tmp_path: Path
) -> None:
    form.locator(".drop").evaluate(DROP, SCENE_XML)
    expect(form.locator(".found")).to_contain_text("dropped.xml")
    scene.write_text(SCENE_XML.replace("256", "192"))
    choose(form, scene)
    expect(form.locator(".found")).to_contain_text("192 × 192 pixels")
    scene.write_text(SCENE_XML.replace("256", "128"))
    choose(form, scene)
    expect(form.locator(".found")).to_contain_text("128 × 128 pixels")
    # A zip says what it holds
    with zipfile.ZipFile(tmp_path / "sphere.zip", "w") as bundle:
        bundle.writestr("scene.xml", SCENE_XML)
        bundle.writestr("notes.txt", "by hand")
    choose(form, tmp_path / "sphere.zip")
    expect(form.locator(".found")).to_contain_text("2 files")


def test_it_works_by_keyboard_alone(form: Page, scene: Path) -> None:
    # Chromium takes a moment to learn that somebody waits for its dialog
    form.on("filechooser", lambda _: None)
    # The file's place is the first thing in the content
    form.keyboard.press("Tab")
    expect(form.get_by_role("link", name="Skip to the content")).to_be_focused()
    form.locator("#main").focus()
    form.keyboard.press("Tab")
    expect(form.locator("#scene-file")).to_be_focused()
    with form.expect_file_chooser() as chooser:
        form.keyboard.press("Enter")
    chooser.value.set_files(scene)
    button = form.get_by_role("button", name="Render it")
    expect(button).to_be_visible()
    # The way past the head leads to the form as it is
    form.get_by_role("link", name="Skip to the content").press("Enter")
    expect(form.locator("#main")).to_be_focused()
    for _ in range(50):
        form.keyboard.press("Tab")
        if button.evaluate("button => button === document.activeElement"):
            break
    form.keyboard.press("Enter")
    expect(form).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))


def test_a_stored_scene_is_used_again(visit: Visit, form: Page, scene: Path) -> None:
    choose(form, scene)
    expect(form.locator(".found")).to_contain_text("sphere.xml")
    again = opened(visit("/submit").page)
    stored = again.get_by_label("A stored scene")
    expect(stored).to_be_visible()
    stored.select_option(label=stored.locator("option").last.inner_text())
    expect(again.locator(".found")).to_contain_text("256 × 256 pixels")


def test_a_scene_is_named_where_it_lies(form: Page, farm: NoiseFarm, folder: Path) -> None:
    walk = folder / "assets" / "walk"
    walk.mkdir(parents=True, exist_ok=True)
    (walk / "scene.xml").write_text(SCENE_XML)
    form.get_by_label("A scene in a scene root").fill("{assets}/walk/scene.xml")
    form.keyboard.press("Enter")
    expect(form.locator(".found")).to_contain_text("256 × 256 pixels")
    form.get_by_role("button", name="Render it").click()
    expect(form).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
    job = farm.jobs.get(form.url.rpartition("/")[2])
    assert (job.name, job.spec.requires) == ("walk", ("root.assets",))


class TestWhatIsRefused:
    @pytest.fixture
    def form(self, visit: Visit) -> Page:
        return opened(visit("/submit", expected={413, 422}).page)

    def test_a_field_that_does_not_fit_is_named_and_focused(
        self, form: Page, farm: NoiseFarm, scene: Path
    ) -> None:
        first = farm.submit("first", batch="evening").id
        choose(form, scene)
        form.get_by_text("More", exact=True).click()
        form.get_by_label("Priority").fill("5")
        form.get_by_label("No sooner than").fill("20000")  # beyond the cap
        form.get_by_role("button", name="Render it").click()
        expect(form.locator(".wrong")).to_contain_text("min_spp must not be above max_spp")
        # What was typed is still there, and can be mended
        form.get_by_label("No sooner than").fill("50")
        form.get_by_label("After", exact=True).fill("nobody")
        form.get_by_role("button", name="Render it").click()
        expect(form.get_by_text("there is no job and no batch 'nobody'").first).to_be_visible()
        form.get_by_label("After", exact=True).fill(f"{first}, evening")
        form.get_by_role("button", name="Render it").click()
        expect(form).to_have_url(re.compile("/jobs/[0-9a-f]{12}$"))
        assert farm.jobs.get(form.url.rpartition("/")[2]).spec.after == (first, "evening")

    def test_a_broken_scene_a_large_file_and_a_parameter_that_is_missing(
        self, form: Page, tmp_path: Path
    ) -> None:
        (tmp_path / "broken.xml").write_text("<scene version='3.0.0'>\n<shape></scene>")
        choose(form, tmp_path / "broken.xml")
        expect(form.get_by_role("alert").filter(has_text="line 2")).to_be_visible()
        expect(form.get_by_role("button", name="Render it")).to_be_hidden()
        (tmp_path / "large.xml").write_bytes(b" " * 6_000_000)
        choose(form, tmp_path / "large.xml")
        expect(form.locator(".wrong")).to_contain_text("more than")
        needy = SCENE_XML.replace('  <default name="width" value="256"/>\n', "")
        (tmp_path / "needy.xml").write_text(needy)
        choose(form, tmp_path / "needy.xml")
        expect(form.locator(".wrong")).to_contain_text("$width has no value")
        form.get_by_label("width", exact=True).fill("80")
        form.get_by_label("width", exact=True).blur()
        expect(form.locator(".found")).to_contain_text("80 × 256 pixels")
        expect(form.get_by_label("height", exact=True)).to_be_visible()

    def test_mistakes_in_a_first_scene_say_what_to_do(self, form: Page, tmp_path: Path) -> None:
        path = tmp_path / "scene.zip"
        for mistake, (_, says) in IN_A_FILE.items():
            with zipfile.ZipFile(path, "w") as bundle:
                bundle.writestr("scene.xml", mistaken(mistake))
                bundle.writestr("art/oak.png", "")
            choose(form, path)
            expect(form.locator(".wrong")).to_have_text(re.compile(says))
            expect(form.get_by_role("button", name="Render it")).to_be_hidden()
        # What was asked of a scene stays there when another is wrong, and leads to what is wrong
        (tmp_path / "scene.xml").write_text(SCENE_XML)
        choose(form, tmp_path / "scene.xml")
        form.get_by_label("At most").fill("2000")
        choose(form, path)
        expect(form.locator(".wrong")).to_be_focused()
        form.get_by_label("At most").focus()
        form.get_by_role("button", name="Render it").click()
        expect(form.locator(".wrong")).to_be_focused()


#: Units in which the form shows what the spec has in others.
PERCENT = ("visible.target", "noise.target", "noise.share")
SHOWN_OVER = {"spec.time_limit_s": 60} | {f"spec.rule.{name}": 0.01 for name in PERCENT}
#: What each number of the form says: which it is, and its input's value and bounds.
NUMBERS = """(form) => [...form.querySelectorAll("input[type=number]")].map((input) => [
    input.name.replace("spec.rule", `spec.rule.${input.closest(".choice")?.dataset.name}`),
    [input.value, input.min, input.max],
])"""


def numbers(path: str, model: type[BaseModel]) -> dict[str, list[float | None]]:
    """The numbers of a spec: where each is, its default, its least and its greatest value."""
    return {
        f"{path}.{name}": [schema["default"], part["minimum"], part["maximum"]]
        for name, schema in model.model_json_schema()["properties"].items()
        for part in schema.get("anyOf", [schema])
        if part.get("type") in {"integer", "number"}
    }


def test_each_number_of_the_form_has_the_default_and_the_bounds_of_the_spec(form: Page) -> None:
    specified = numbers("spec", JobSpec) | numbers("spec.view", ViewSpec)
    specified |= numbers("spec.allocation", ZonesAllocation)
    del specified["spec.frame_seed"]  # which a batch gives to its frames
    for rule in get_args(get_args(RuleSpec)[0]):
        specified |= numbers(f"spec.rule.{rule.model_fields['name'].default}", rule)
    asked = {
        name: [float(one) * SHOWN_OVER.get(name, 1) if one else None for one in shown]
        for name, shown in form.locator("form").evaluate(NUMBERS)
        if not name.startswith("frames.")
    }
    assert asked == {name: pytest.approx(three) for name, three in specified.items()}
    # It names every AOV, and has every way to write them
    for name in AOV_NAMES:
        expect(form.locator(".help", has_text="Besides colour")).to_contain_text(name)
    for name, field in ExrSpec.model_fields.items():
        choices = form.locator(f"select[name='spec.exr.{name}'] option").all_text_contents()
        assert form.locator(f"select[name='spec.exr.{name}']").input_value() == field.default
        assert set(choices) == set(get_args(field.annotation))
    # And all of a spec but what it need not have
    elsewhere = {"parameters", "rule", "frame_seed", "shot", "allocation", "denoise"}
    elsewhere |= {"inputs", "variance", "pictures"}  # of data sets
    named = form.locator("form [name]").evaluate_all("all => all.map(one => one.name)")
    top = {name.split(".")[1] for name in named if name.startswith("spec.")}
    assert set(JobSpec.model_fields) <= top | elsewhere
