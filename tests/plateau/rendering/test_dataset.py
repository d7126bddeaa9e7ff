"""`plateau dataset`: a folder that can be trusted, whatever is killed, changed or full."""

import json
import re
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plateau.errors import CommandFailed
from plateau.farm.images.exr import decode_layers
from plateau.files.held import Held, held
from plateau.processes.interrupts import Interrupts
from plateau.rendering.dataset import manifest
from plateau.rendering.dataset.recipe import Recipe
from plateau.rendering.dataset.run import fill
from plateau.rendering.mapping import Place
from tests.support.farms.real_farm import RealFarm
from tests.support.processes.commands import Command, plateau
from tests.support.scenes.bundles import PLY, mesh, scene
from tests.support.until import until

CHECKS = {"analytic": 1, "width": 24, "height": 16, "light": "checks", "level": 0.2}
RECIPE = """
scenes = ["checks.json"]
target = "fixed:spp=16"
[parameters]
level = {from = 0.1, to = 0.8, count = 8}
"""
Fill = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def run(farm: RealFarm, tmp_path: Path) -> Fill:
    """Fills a folder by a recipe, and returns its lines, the worst first."""
    (tmp_path / "checks.json").write_text(json.dumps(CHECKS))

    def filled(recipe: str = RECIPE, folder: str = "out") -> list[dict[str, Any]]:
        (tmp_path / "recipe.toml").write_text(recipe)
        asked, place = Recipe.read(tmp_path / "recipe.toml"), Place(farm=farm.url)
        folder_ = tmp_path / folder
        return fill(asked, folder_, place, Interrupts(), show=lambda _: None, tell=print)

    return filled


def lines(folder: Path) -> list[dict[str, Any]]:
    """Its whole lines: the last one may just be written, or be half of one that was."""
    written = (folder / manifest.NAME).read_text().rpartition("\n")[0]
    return [json.loads(line) for line in written.splitlines()]


def test_a_killed_run_goes_on_and_renders_nothing_twice(run: Fill, tmp_path: Path) -> None:
    levels = [0.1 + index / 60 for index in range(40)]
    recipe = RECIPE.replace("{from = 0.1, to = 0.8, count = 8}", str(levels))
    (tmp_path / "recipe.toml").write_text(recipe)
    out = tmp_path / "out"
    asked = (str(tmp_path / "recipe.toml"), "-o", str(out), "--threads", "1")
    command = Command("dataset", *asked, folder=tmp_path / "of-the-command")
    until(lambda: (out / manifest.NAME).exists() and len(lines(out)) > 3)
    assert command.family()
    command.process.kill()
    command.process.wait()
    command.is_gone()
    # A kill may leave half a line and half a file
    had = {line["index"]: line for line in lines(out)}
    assert len(had) < 40
    written = {name: (out / name).stat().st_ino for one in had.values() for name in one["files"]}
    with (out / manifest.NAME).open("a") as file:
        file.write('{"index": 39, "sta')
    (out / f"half.exr{manifest._PART}").write_bytes(b"half")
    found = run(recipe)
    assert len(found) == len(lines(out)) == 40
    assert {line["index"] for line in found} == set(range(40))
    assert all((out / name).stat().st_ino == node for name, node in written.items())
    assert {path.suffix for path in out.iterdir()} == {".exr", ".jsonl"}
    # It is what a run that nobody kills leaves, on a farm that is not its own
    for line in run(recipe.replace(str(levels), str(levels[:12])), "whole"):
        (name,) = line["files"]
        ours, theirs = (
            decode_layers((tmp_path / one / name).read_bytes()) for one in ("out", "whole")
        )
        assert all(np.array_equal(ours[channel], theirs[channel]) for channel in "RGB")


def test_another_recipe_and_another_run_are_refused(run: Fill, tmp_path: Path) -> None:
    run()
    before = lines(tmp_path / "out")
    for changed, says in (
        (RECIPE.replace("spp=16", "spp=8"), r"Image 0: rule was .*16.*, and is .*8"),
        (RECIPE.replace("0.8", "0.9"), r"Image 1: parameters was .*, and is "),
        (RECIPE.replace("count = 8", "count = 1"), "Image 1: the recipe has no such image"),
        (f"inputs = [2]\n{RECIPE}", r"inputs was the default, and is \[2\]"),
    ):
        with pytest.raises(CommandFailed, match=says):
            run(changed)
    (tmp_path / "checks.json").write_text(json.dumps({**CHECKS, "height": 17}))
    with pytest.raises(CommandFailed, match="a file of its scene has changed"):
        run()
    (tmp_path / "checks.json").write_text(json.dumps(CHECKS))
    with held(tmp_path / "out"), pytest.raises(Held, match="is being written by process"):
        run()
    assert lines(tmp_path / "out") == before
    # More at its end are welcome, and a file that is gone is made again
    (tmp_path / "out" / "checks-000002.exr").unlink()
    more = RECIPE.replace("{from = 0.1, to = 0.8, count = 8}", "[0.1, 0.2]")
    run(more, "few")
    assert len(run(more.replace("0.2]", "0.2, 0.3]"), "few")) == 3
    assert len(lines(tmp_path / "few")) == 3
    run()
    assert [line["index"] for line in lines(tmp_path / "out")[8:]] == [2]


def test_a_mesh_that_has_changed_is_seen(run: Fill, tmp_path: Path) -> None:
    lit = "<integrator type='path'/><emitter type='constant'/>"
    (tmp_path / "mesh.xml").write_bytes(scene(lit, mesh("$of")))
    for name in "ab":
        (tmp_path / f"{name}.ply").write_bytes(PLY)
    recipe = """
scenes = ["mesh.xml"]
target = "fixed:spp=1"
parameters = [{of = "a.ply"}]
spec = {variant = "scalar_rgb"}
"""
    run(recipe)
    more = recipe.replace("}]", "}, {of = 'b.ply'}]")
    assert len(run(more)) == 2
    (tmp_path / "b.ply").write_bytes(PLY.replace(b"0 1 0", b"0 2 0"))
    with pytest.raises(CommandFailed, match="Image 1: a file of its scene has changed"):
        run(more)


def test_what_fails_and_what_misses_its_target_are_said(
    run: Fill, farm: RealFarm, tmp_path: Path
) -> None:
    recipe = """
scenes = ["checks.json", "gone.json"]
target = "relmse:target=1e-9"
spec = {max_spp = 256}
"""
    (tmp_path / "recipe.toml").write_text(recipe)
    out = tmp_path / "out"
    asked = ("dataset", tmp_path / "recipe.toml", "-o", out, "--url", farm.url)
    code, printed, progress = plateau(*asked, "--sheet")
    assert code == 1
    said = printed.splitlines()
    assert said[0] == "1 failed, 1 exhausted"
    assert re.search(r"gone-000001: .*gone\.json", said[1])
    assert re.search(r"checks-000000: reached the cap of 256 spp; the squared error is ", said[2])
    assert "2 of 2 images, 1 failed" in progress
    # The sheet has them in the same order, the one with its picture
    sheet = (out / "sheet.html").read_text()
    assert sheet.index("gone-000001") < sheet.index("<img ") < sheet.index("checks-000000")
    assert sheet.count("<img ") == 1
    reached = next(line for line in lines(out) if line["index"] == 0)["errors"]["relmse"]
    assert 1e-9 < reached["low"] < reached["value"] < reached["high"]
    # Mended, it is tried again
    (tmp_path / "gone.json").write_text(json.dumps(CHECKS))
    code, printed, _ = plateau(*asked, "--json")
    assert (code, {line["state"] for line in json.loads(printed)}) == (3, {"exhausted"})
    assert [line["index"] for line in lines(out)].count(0) == 1


def test_a_full_disk_leaves_nothing_half(tmp_path: Path) -> None:
    with manifest.opened(tmp_path) as there:
        (tmp_path / f"a.exr{manifest._PART}").symlink_to("/dev/full")
        with pytest.raises(CommandFailed, match=r"No space left.*run the same command again"):
            there.add({"index": 0, "state": "converged", "digest": ""}, {"a.exr": bytes(9)})
        assert {path.name for path in tmp_path.iterdir()} - {".plateau-lock"} == {manifest.NAME}
        there.add({"index": 0, "state": "converged", "digest": ""}, {"a.exr": bytes(9)})
        assert there.has(0)
        (tmp_path / "a.exr").write_bytes(b"")
        assert not there.has(0)


def test_oidn_finds_its_inputs_and_targets(run: Fill, tmp_path: Path) -> None:
    """As `get_image_sample_groups` of OIDN's training reads a folder: the last name is a target."""
    oidn = f'inputs = [1, 4]\nlayout = "oidn"\n{RECIPE}'
    (line, *_) = run(oidn.replace("8}", "2}"))
    assert line["spp"] == 16
    groups = defaultdict(set)
    for path in (tmp_path / "out").glob("*.*.exr"):
        name, feature, _ = path.name.rsplit(".", 2)
        group, spp = name.rsplit("_", 1)
        assert re.fullmatch(r"\d{4}spp", spp)
        groups[group].add((name, feature))
    assert len(groups) == 2
    for group, files in groups.items():
        names = sorted({name for name, _ in files})
        assert names == [f"{group}_{spp:04d}spp" for spp in (1, 4, 16)]
        assert files == {(name, feature) for name in names for feature in ("hdr", "alb", "nrm")}
    run(oidn.replace("layout", "aovs = ['albedo', 'normal']\n#").replace("8}", "2}"), "plain")
    plain = decode_layers((tmp_path / "plain" / "checks-000001.exr").read_bytes())
    for name, layer, channels in (("0004spp.hdr", "spp0004.", "RGB"), ("0016spp.nrm", "N.", "XYZ")):
        read = decode_layers((tmp_path / "out" / f"checks-000001_{name}.exr").read_bytes())
        for channel, source in zip("RGB", channels, strict=True):
            np.testing.assert_array_equal(read[channel], plain[f"{layer}{source}"])
    with pytest.raises(CommandFailed, match="16 spp must be above the last of inputs, 16"):
        run(oidn.replace("1, 4", "1, 16"), "other")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("scenes = [", "is no TOML"),
        ("target = 'jod'", "scenes: is missing"),
        ("scenes = 'box.xml'", "scenes: must be a list"),
        ("scenes = ['*.xml']", "there is no scene"),
        ("scenes = ['/nowhere/*.xml']", "there is no scene"),
        ("scenes = ['a']\nmax_spp = 3", r"max_spp: there is no such field.* under \[spec\]"),
        ("scenes = ['a']\nlayout = 'png'", "layout: must be exr or oidn"),
        ("scenes = ['a']\nspec = {max_sp = 3}", r"max_sp: there is no such field"),
        ("scenes = ['a']\nparameters = {x = {from = 1}}", "x must be like"),
    ],
)
def test_a_wrong_recipe_says_what_to_change(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    with pytest.raises(Exception, match=says):
        list(Recipe.read(path).tasks) and Recipe.read(path).job_spec
