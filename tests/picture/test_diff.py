"""Two image files are compared, and what cannot be compared is refused in a line."""

import doctest
import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from typer.testing import CliRunner

import plateau.picture.diff
from plateau.commands import app
from plateau.farm.images.png import encode_png
from plateau.picture.diff import compare_files, share
from tests.support.images.plain_exr import encode_image

ROOT = Path(__file__).parents[2]
GOLDENS = ROOT / "tests" / "reference" / "goldens"
ROWS = json.loads((GOLDENS / "counts.json").read_text())
RNG = np.random.default_rng(11)


def arguments_of(row):
    """The command line that asks for a row of the goldens."""
    given = [
        *(str(GOLDENS / f"{row['pair']}.{side}.png") for side in "ab"),
        *("--primaries", "adobe1998", "--json"),
        *("--field-of-view", str(row["field_of_view_deg"])),
        *("--white-luminance", str(row["white_luminance"])),
    ]
    if row["gamma"] != 2.2:  # the default for PNG
        given += ["--gamma", str(row["gamma"])]
    if row["luminance_only"]:
        given += ["--luminance-only"]
    return given


def is_golden(output, row):
    found = json.loads(output)
    pixels = row["width"] * row["height"]
    assert (found["width"], found["height"]) == (row["width"], row["height"])
    assert found["visible_fraction"] == found["visible_pixels"] / pixels
    assert found["non_finite_pixels"] == 0
    return abs(found["visible_pixels"] - row["visible_pixels"]) <= 2


def row_id(row):
    return "-".join(str(value) for key, value in row.items() if key != "visible_pixels")


@pytest.mark.parametrize("row", ROWS[:: len(ROWS) // 12], ids=row_id)
def test_the_goldens_come_out_of_the_command_line(row):
    """Some of each kind: `tests/metric/test_goldens.py` has them all."""
    result = CliRunner().invoke(app, ["diff", *arguments_of(row)])

    assert result.exit_code == 0
    assert is_golden(result.stdout, row)


# Files to compare.


@pytest.fixture
def file(tmp_path):
    """Writes an image: code values where the name ends in .png, radiance in .exr."""

    def write(name, pixels):
        encode = encode_png if name.endswith(".png") else encode_image
        (tmp_path / name).write_bytes(encode(pixels))
        return tmp_path / name

    return write


def grey(level=128, shape=(32, 48)):
    return np.full((*shape, 3), level, np.uint8)


def with_a_spot(pixels, value):
    spotted = pixels.copy()
    spotted[10:14, 20:24] = value
    return spotted


def diff(*arguments):
    return CliRunner().invoke(app, ["diff", *map(str, arguments)])


def refused(*arguments):
    """The one line in which the command refuses its arguments."""
    result = diff(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("plateau: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def test_it_says_how_many_pixels_differ_visibly(file):
    reference, test = file("a.png", grey()), file("b.png", with_a_spot(grey(), 255))

    assert diff(reference, test).stdout == "16 of 1,536 pixels (1.0 %) differ visibly\n"
    assert diff(reference, reference).stdout == "0 of 1,536 pixels (0 %) differ visibly\n"


def test_a_share_says_0_and_100_only_where_it_is():
    assert [share(count, 100_000) for count in (0, 1, 99, 100, 50_000, 99_900, 99_901, 99_999)] == [
        *("0 %", "under 0.1 %", "under 0.1 %", "0.1 %", "50.0 %", "99.9 %"),
        *("over 99.9 %", "over 99.9 %"),
    ]
    assert share(100_000, 100_000) == "100 %"
    assert doctest.testmod(plateau.picture.diff).failed == 0


def test_the_map_marks_the_visible_pixels_on_the_test_image(file, tmp_path):
    reference, test = file("a.png", grey()), file("b.png", with_a_spot(grey(), 255))

    assert diff(reference, test, "--map", tmp_path / "map.png").exit_code == 0

    picture = np.asarray(Image.open(tmp_path / "map.png").convert("RGB"))
    visible = compare_files(reference, test).difference.visible
    assert visible[10:14, 20:24].all()
    marked = (picture == [255, 140, 0]).all(axis=-1)
    assert np.array_equal(marked, visible)
    # The rest is the image in dim grey: 128 at a gamma of 2.2 is 129 in sRGB, and a third of that.
    assert (picture[~visible] == 43).all()


class TestTheQuality:
    def test_is_said_and_mapped(self, file, tmp_path):
        reference, test = file("a.png", grey()), file("b.png", with_a_spot(grey(), 255))

        words = diff(reference, test, "--jod", "--heat", tmp_path / "heat.png").stdout.splitlines()

        assert words[0] == "16 of 1,536 pixels (1.0 %) differ visibly"
        assert 5 < float(words[1].removesuffix(" JOD")) < 9.9
        # Where the spot is, the map has another colour than far from it
        heat = np.asarray(Image.open(tmp_path / "heat.png").convert("RGB")).astype(int)
        assert np.abs(heat[12, 22] - heat[31, 0]).max() > 50
        assert diff(reference, reference, "--jod").stdout.endswith("10.00 JOD\n")
        in_json = json.loads(diff(reference, test, "--jod", "--json").stdout)
        assert f"{in_json['jod']:.2f} JOD" == words[1]

    def test_depends_on_where_the_image_is_seen(self, file):
        reference, test = file("a.png", grey()), file("b.png", with_a_spot(grey(), 160))
        at = {
            place: json.loads(diff(reference, test, "--jod", "--json", "--seen", place).stdout)
            for place in ("desk", "phone")
        }
        assert at["desk"]["jod"] < at["phone"]["jod"]
        assert at["phone"]["view"]["pixels_per_degree"] == 120
        assert at["phone"]["view"]["white_luminance"] == 500

    def test_of_an_image_too_small_for_it_is_refused(self, file):
        tiny = file("a.png", grey(shape=(2, 2)))
        assert "4" in refused(tiny, tiny, "--jod")


def test_a_place_and_an_angle_are_not_both_given(file):
    image = file("a.png", grey())
    both = ("--seen", "desk", "--field-of-view", "20")
    assert "say at which angle a pixel is seen" in refused(image, image, *both)


def test_the_map_lies_on_the_test_image_and_not_on_the_reference(file):
    reference, test = file("a.png", grey(40)), file("b.png", grey(200))
    shown = compare_files(reference, test).shown
    assert shown == pytest.approx((200 / 255) ** 2.2, rel=1e-5)


def test_the_map_does_not_overwrite_what_is_compared(file, tmp_path):
    reference, test = file("a.png", grey()), file("b.png", grey(0))
    assert "would overwrite" in refused(reference, test, "--map", test)
    assert not np.asarray(Image.open(test)).any()


def test_a_map_that_cannot_be_written_is_not_the_images_fault(file, tmp_path):
    reference = file("a.png", grey())
    result = diff(reference, reference, "--map", tmp_path / "nowhere" / "map.png")
    assert result.exit_code == 1
    assert "nowhere" in result.stderr


def test_png_is_read_with_a_gamma_and_exr_is_linear(file):
    values = RNG.integers(0, 256, (32, 48, 3), dtype=np.uint8)
    other = np.clip(values + RNG.integers(-30, 31, values.shape), 0, 255).astype(np.uint8)
    as_png = compare_files(file("a.png", values), file("b.png", other))

    light = [
        np.power(image.astype(np.float32) / np.float32(255), np.float32(2.2))
        for image in (values, other)
    ]
    as_exr = compare_files(file("a.exr", light[0]), file("b.exr", light[1]))

    assert (as_png.view.gamma, as_exr.view.gamma) == (2.2, 1.0)
    assert 0 < as_png.difference.count < values.size / 3
    assert np.array_equal(as_png.difference.visible, as_exr.difference.visible)


@pytest.mark.parametrize(
    "option",
    [
        ("--field-of-view", "45"),
        ("--white-luminance", "1"),
        ("--gamma", "1"),
        ("--primaries", "adobe1998"),
        ("--luminance-only",),
        ("--exposure", "-6"),
    ],
)
def test_every_option_of_the_view_counts(option, file):
    image = RNG.random((64, 96, 3), np.float32)
    noise = RNG.normal(0, 0.08, image.shape).astype(np.float32)
    files = file("a.exr", image**2.2), file("b.exr", np.abs(image + noise) ** 2.2)
    if option[0] == "--gamma":
        option = ("--gamma", "1.5")

    usual, with_option = (json.loads(diff(*files, "--json", *more).stdout) for more in ((), option))

    assert usual["view"] != with_option["view"]
    assert usual["visible_pixels"] != with_option["visible_pixels"]


def test_nan_and_infinite_pixels_are_counted_and_visible(file):
    image = np.full((32, 48, 3), 0.5, np.float32)
    broken = image.copy()
    broken[3, 5, 1] = np.nan
    broken[20, 30] = np.inf
    reference, test = file("a.exr", image), file("b.exr", broken)

    found = json.loads(diff(reference, test, "--json").stdout)

    assert found["non_finite_pixels"] == 2
    visible = compare_files(reference, test).difference.visible
    assert visible[3, 5]
    assert visible[20, 30]
    assert diff(reference, test).stdout.endswith(
        "; 2 of them are NaN or infinite, the first at (5, 3)\n"
    )
    assert found["non_finite_at"] == [5, 3]
    assert diff(test, test).stdout.startswith("2 of 1,536 pixels")


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (40, 1), (2, 2)])
def test_the_smallest_images_are_right(shape, file):
    black, white = file("a.png", grey(0, shape)), file("b.png", grey(255, shape))
    pixels = shape[0] * shape[1]
    assert compare_files(black, black).difference.count == 0
    assert compare_files(black, white).difference.count == pixels
    verb, noun = ("differs", "pixel") if pixels == 1 else ("differ", "pixels")
    assert diff(black, white).stdout == f"{pixels} of {pixels} {noun} (100 %) {verb} visibly\n"


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_a_transparent_png_is_laid_over_black_in_linear_light(gamma, file):
    see_through = np.dstack([grey(200), np.full((32, 48), 51, np.uint8)])  # a fifth
    shown = compare_files(file("a.png", grey()), file("b.png", see_through), gamma=gamma).shown
    assert shown == pytest.approx((200 / 255) ** gamma / 5, rel=1e-4)
    opaque = np.dstack([grey(), np.full((32, 48), 255, np.uint8)])
    assert compare_files(file("a.png", grey()), file("c.png", opaque)).difference.count == 0


def test_a_layer_is_chosen_by_its_name(file, tmp_path):
    image = RNG.random((32, 48, 3), np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    layered = tmp_path / "layered.exr"
    with OpenEXR.File(header, {"RGB": image, "albedo": np.zeros_like(image)}) as exr:
        exr.write(str(layered))
    black = file("black.exr", np.zeros_like(image))
    assert compare_files(file("plain.exr", image), layered).difference.count == 0
    assert compare_files(layered, layered, layer="albedo").shown.max() == 0
    assert "no layer 'albedo'" in refused(layered, black, "--layer", "albedo")
    assert "--layer is for EXR" in refused(*[file("a.png", grey())] * 2, "--layer", "albedo")


# What cannot be compared.


def test_sizes_that_differ(file):
    line = refused(file("a.png", grey()), file("b.png", grey(shape=(32, 40))))
    assert "48×32 and 40×32" in line


def test_a_png_and_an_exr(file):
    files = file("a.png", grey()), file("b.exr", np.ones((32, 48, 3), np.float32))
    assert "PNG" in refused(*files)
    assert "EXR" in refused(*files)


def test_no_such_file_and_no_file_at_all(file, tmp_path):
    image = file("a.png", grey())
    assert "No such file" in refused(image, tmp_path / "missing.png")
    assert str(tmp_path) in refused(tmp_path, image)


@pytest.mark.parametrize("content", [b"", b"P6 1 1 255 abc", b"\xff\xd8\xff\xe0"])
def test_other_files_whatever_their_name(content, file, tmp_path):
    (tmp_path / "b.png").write_bytes(content)
    assert "neither a PNG nor an EXR" in refused(file("a.png", grey()), tmp_path / "b.png")


@pytest.mark.parametrize("keep", [20, 0.95])
@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_files_cut_short(name, keep, file, tmp_path):
    noise = RNG.random((32, 48, 3), np.float32)
    whole = file(name, (noise * 255).astype(np.uint8) if name == "a.png" else noise)
    content = whole.read_bytes()
    cut = tmp_path / f"cut-{name}"
    cut.write_bytes(content[: keep if isinstance(keep, int) else int(keep * len(content))])

    assert str(cut) in refused(whole, cut)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--gamma", "0"),
        ("--gamma", "nan"),
        ("--field-of-view", "180"),
        ("--white-luminance", "0"),
        ("--white-luminance", "20001"),
        ("--exposure", "101"),
        ("--primaries", "rec2020"),
    ],
)
def test_a_value_out_of_its_domain_is_refused_by_its_option(option, value, file):
    image = file("a.png", grey())
    assert refused(image, image, option, value).startswith(f"plateau: {option} must")
