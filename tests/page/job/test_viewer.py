"""An image looked at closely: pixels, channels, false colours, another job beside it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from plateau.farm.images.exr import decode_layers
from plateau.farm.model.job import Job
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.page.conftest import Visit
from tests.page.job.test_job import is_shown, pixels, png
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import SIZE, NoiseFarm
from tests.support.processes.browser import Visitor

HEIGHT, WIDTH = SIZE
SPEC = {"step": 25, "max_spp": 50, "rule": {"name": "fixed", "spp": 50}}
STYLE = Path(__file__).parents[3] / "service" / "page" / "job" / "viewer" / "viewer.css"


@dataclass(frozen=True)
class Two:
    """Two finished jobs of one size, the first with alpha and AOVs, and where they can be seen."""

    farm: NoiseFarm
    one: Job
    other: Job
    url: str

    def layers(self, job: Job) -> dict[str, np.ndarray]:
        return decode_layers(self.farm.picture(job, "image.exr"))


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Two]:
    """Only looked at, so they are rendered once, with a Redis of their own."""
    folder = tmp_path_factory.mktemp("two")
    server = EmbeddedRedis(folder / "redis")
    client = connect(server.url)
    farm = NoiseFarm(client, server.url, folder, alpha=True)
    with farm.monitor():
        one = farm.finish(farm.submit("dusk", **SPEC, aovs=["normal", "depth", "shape_id"]))
        farm.alpha = False
        other = farm.finish(farm.submit("dawn", **SPEC, seed=7))
    with live_api(server.url, farm.store) as url:
        yield Two(farm, one, other, url)
    client.close()
    server.stop()


@pytest.fixture(scope="module")
def looker(browser: Browser, two: Two) -> Iterator[Visitor]:
    visitor = Visitor(browser, two.url)
    yield visitor
    visitor.leave()


@pytest.fixture
def page(looker: Visitor, two: Two) -> Page:
    """The first job's screen, as it is at first."""
    looker.page.mouse.move(0, 0)
    looker.page.goto(f"/jobs/{two.one.id}")
    expect(looker.page.locator(".frame .layer").first).to_be_visible()
    return looker.page


def values(page: Page) -> list[dict[str, str]]:
    """The rows of the table of a pixel's values, by column."""
    columns = page.locator(".inspect thead th").all_text_contents()
    return [
        dict(zip(columns, row.locator("td").all_text_contents(), strict=True))
        for row in page.locator(".inspect tbody tr").all()
    ]


def inspect(page: Page) -> None:
    page.get_by_text("Pixel values and histogram").click()
    expect(page.locator(".inspect thead")).to_contain_text("luminance")


def test_pixels_are_crisp(page: Page, two: Two) -> None:
    page.goto(f"/jobs/{two.other.id}")
    layer, frame = page.locator("img.layer").first, page.locator(".frame")
    picture = png(two.farm.picture(two.other, "image.png"))
    expect(layer).to_be_visible()
    # At 1:1, each is one of the display's
    frame.press("1")
    expect(page.locator(".zoom")).to_have_text("100 %")
    # (all but the edge, which the browser blends with what is behind it)
    assert (png(layer.screenshot()) == picture)[1:-1, 1:-1].all()
    # Zoomed, each has sharp edges: no colour lies between those of two
    frame.press("0")
    colours = {tuple(colour) for colour in picture.reshape(-1, 3)}
    inside = png(layer.screenshot())[4:-4, 4:-4].reshape(-1, 3)
    assert {tuple(colour) for colour in inside} <= colours


class TestPixels:
    def test_have_the_values_of_the_exr(self, page: Page, two: Two) -> None:
        layers = two.layers(two.one)
        inspect(page)
        for x, y in ((0, 0), (WIDTH - 1, HEIGHT - 1), (7, 3)):
            page.get_by_label("Pixel from the left").fill(str(x))
            page.get_by_label("Pixel from the top").fill(str(y))
            [row] = values(page)
            assert list(row) == ["R", "G", "B", "A", "luminance"]
            for name in "RGBA":
                assert float(row[name]) == pytest.approx(layers[name][y, x], rel=1e-4)
            weights = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
            light = sum(weights[name] * layers[name][y, x] for name in "RGB")
            assert float(row["luminance"]) == pytest.approx(light, rel=1e-4)
        page.get_by_label("Pixel from the left").fill(str(WIDTH))
        assert set(values(page)[0].values()) == {"–"}

    def test_are_those_under_the_pointer(self, page: Page) -> None:
        inspect(page)
        page.locator(".frame").scroll_into_view_if_needed()
        box = page.locator("img.layer").first.bounding_box()
        assert box is not None
        page.mouse.move(
            box["x"] + 12.5 / WIDTH * box["width"], box["y"] + 5.5 / HEIGHT * box["height"]
        )
        expect(page.get_by_label("Pixel from the left")).to_have_value("12")
        expect(page.get_by_label("Pixel from the top")).to_have_value("5")
        mark = page.locator(".mark").bounding_box()
        assert mark is not None
        assert mark["x"] == pytest.approx(box["x"] + 12 / WIDTH * box["width"], abs=2)

    def test_have_a_histogram(self, page: Page, two: Two) -> None:
        layers = two.layers(two.one)
        inspect(page)
        shown = page.locator(".histograms figcaption")
        expect(shown).to_contain_text("final image: R, G, B from")
        least, most = re.findall(r"from (\S+) to ([\d.]+)", shown.inner_text())[0]
        colour = np.stack([layers[name] for name in "RGB"])
        assert float(least.replace("−", "-")) == pytest.approx(colour.min(), rel=0.01)
        assert float(most) == pytest.approx(colour.max(), rel=0.01)
        expect(page.locator(".histogram path")).to_have_count(4)  # and the line of white
        page.get_by_label("Channel").select_option(label="Luminance")
        expect(page.locator(".histogram path")).to_have_count(2)
        expect(shown).to_contain_text("luminance from")


class TestChannels:
    def canvas(self, page: Page) -> np.ndarray:
        canvas = page.locator("canvas.layer").first
        expect(canvas).to_be_visible()
        return pixels(canvas)

    def pick(self, page: Page, title: str, *, layer: str) -> np.ndarray:
        """Show a channel that is offered once the image has been read."""
        inspect(page)
        page.get_by_label("Channel").select_option(label=title)
        expect(page.locator(".inspect thead")).to_contain_text(layer)
        return self.canvas(page)

    def test_are_those_of_the_image(self, page: Page) -> None:
        inspect(page)
        expect(page.get_by_label("Channel").locator("option")).to_have_text(
            [
                *("Colour", "Luminance", "Red", "Green", "Blue", "Alpha"),
                *("Normals", "Depth", "Shape ids"),
            ]
        )

    def test_a_depth_is_shown_from_its_least_to_its_greatest(self, page: Page, two: Two) -> None:
        depth = two.layers(two.one)["Z"]
        least, most = depth.min(), depth.max()
        shown = self.pick(page, "Depth", layer="Z")
        wanted = 255 * (depth - least) / (most - least)
        assert np.abs(shown - wanted[..., None]).max() <= 1
        [row] = values(page)
        assert float(row["Z"]) == pytest.approx(depth[0, 0], rel=1e-4)
        expect(
            page.get_by_text(re.compile(r"From [\d.]+ \(dark\) to [\d.]+ \(bright\)"))
        ).to_be_visible()

    def test_normals_are_three_colours(self, page: Page, two: Two) -> None:
        layers = two.layers(two.one)
        normals = np.stack([layers[f"N.{axis}"] for axis in "XYZ"], axis=-1)
        shown = self.pick(page, "Normals", layer="N.Z")
        wanted = 255 * (normals - normals.min()) / (normals.max() - normals.min())
        assert np.abs(shown - wanted).max() <= 1

    def test_each_id_has_its_colour(self, page: Page, two: Two) -> None:
        ids = two.layers(two.one)["id.shape"]
        shown = self.pick(page, "Shape ids", layer="id.shape")
        colours = {number: {tuple(c) for c in shown[ids == number]} for number in np.unique(ids)}
        assert len(colours) > 1
        assert all(len(one) == 1 for one in colours.values())
        assert len(set.union(*colours.values())) == len(colours)

    def test_one_part_of_the_colour_is_grey(self, page: Page) -> None:
        page.get_by_label("Channel").select_option(label="Red")
        shown = self.canvas(page)
        assert (shown[..., 0] == shown[..., 2]).all()
        page.get_by_role("button", name="As judged").click()
        expect(page.locator("canvas.layer").first).to_be_hidden()
        expect(page.get_by_label("Channel")).to_have_value("")

    def test_false_colours_say_the_exposure(self, page: Page, two: Two) -> None:
        page.get_by_label("False colour").check()
        shown = self.canvas(page)
        layers = two.layers(two.one)
        light = 0.2126 * layers["R"] + 0.7152 * layers["G"] + 0.0722 * layers["B"]
        with np.errstate(divide="ignore"):
            place = np.clip((np.log2(np.maximum(light, 0)) + 8) / 12, 0, 1)
        stops = re.findall(r"#([0-9a-f]{6})", re.search(r"\.viridis .*", STYLE.read_text())[0])
        palette = np.array([[int(stop[at : at + 2], 16) for at in (0, 2, 4)] for stop in stops])
        wanted = np.stack(
            [np.interp(place, np.linspace(0, 1, len(stops)), part) for part in palette.T], axis=-1
        )
        assert np.abs(shown - wanted).max() <= 1
        expect(page.locator(".scale:visible output")).to_have_text(
            ["white − 8 EV", "− 2 EV", "+ 4 EV"]
        )
        # Two EV more light are two EV along the scale
        page.get_by_label("Exposure").fill("2")
        later = np.clip(place + 2 / 12, 0, 1)[place > 0]
        wanted = np.interp(later, np.linspace(0, 1, len(stops)), palette[:, 1])
        assert np.abs(self.canvas(page)[..., 1][place > 0] - wanted).max() <= 1


class TestTwoJobs:
    def test_are_compared_and_flipped(self, page: Page, two: Two) -> None:
        page.get_by_role("button", name="Compare").click()
        page.get_by_label("The other job").select_option(two.other.id)
        for side in ("Left", "Right"):
            page.get_by_role("combobox", name=side).select_option(label="final image")
        for number, job in enumerate((two.one, two.other)):
            layer = page.locator(".side img").nth(number)
            expect(layer).to_be_visible()
            is_shown(layer, png(two.farm.picture(job, "image.png")))
        expect(page).to_have_url(re.compile(f"{two.one.id}\\?with={two.other.id}$"))
        one, other = f"dusk {two.one.id[:6]}", f"dawn {two.other.id[:6]}"
        caption = page.locator(".caption")
        expect(caption).to_contain_text(f"{one}, final image at the left, {other}, final image at")
        page.locator(".frame").focus()
        for key, clip, alone in (("f", "0%", other), ("f", "100%", one), ("f", "0%", other)):
            page.keyboard.press(key)
            expect(page.locator(".side").last).to_have_css(
                "clip-path", f"inset(0px 0px 0px {clip})"
            )
            expect(caption).to_contain_text(f"{alone}, final image alone")
        # The values of both, under the pointer
        inspect(page)
        expect(page.locator(".inspect tbody tr")).to_have_count(2)
        reds = [float(row["R"]) for row in values(page)]
        wanted = [two.layers(job)["R"][0, 0] for job in (two.one, two.other)]
        assert reds == pytest.approx(wanted, rel=1e-4)
        expect(page.locator(".histogram")).to_have_count(2)
        # A reload comes back to the same two
        page.reload()
        expect(page.get_by_label("The other job")).to_have_value(two.other.id)

    def test_are_chosen_in_the_list(self, page: Page, two: Two) -> None:
        page.goto("/")
        page.get_by_role("checkbox", name="Select dusk").check()
        link = page.get_by_role("link", name="Compare", exact=True)
        expect(link).to_be_hidden()
        page.get_by_role("checkbox", name="Select dawn").check()
        link.click()
        expect(page).to_have_url(re.compile(r"/jobs/\w+\?with=\w+$"))
        expect(page.locator(".side").last).to_be_visible()

    def test_a_job_of_another_size_is_refused(self, visit: Visit, two: Two) -> None:
        visitor = visit(f"/jobs/{two.one.id}?with=0123456789ab", url=two.url, expected={404})
        hint = "Job 0123456789ab has no image of 32 × 24 pixels to compare."
        expect(visitor.page.get_by_text(hint)).to_be_visible()
