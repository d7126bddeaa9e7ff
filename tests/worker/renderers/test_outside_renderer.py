"""A renderer from an installed distribution: known everywhere, and rendered by a real worker."""

import itertools
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.images.exr import decode_image
from tests.support.processes.commands import Command, starting

TOY = Path(__file__).parents[2] / "support" / "toy_renderer"
SIZE = (24, 16)

Start = Callable[..., Command]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    numbers = itertools.count()

    def start(*arguments: str) -> Command:
        # With a cache of its own: what was found with fewer renderers is no longer so
        there = {"PYTHONPATH": str(TOY), "PLATEAU_CACHE": str(tmp_path / "cache")}
        return Command(*arguments, folder=tmp_path / str(next(numbers)), **there)

    yield from starting(start)


def test_a_worker_renders_its_scenes(start: Start, tmp_path: Path) -> None:
    # Given a folder with one of its scenes, and what the scene may refer to
    (tmp_path / "shot").mkdir()
    (tmp_path / "shot" / "flat.toy").write_text(f"TOY {SIZE[0]} 99")
    (tmp_path / "shot" / "palette.txt").write_text("grey")
    render = start(
        *("render", str(tmp_path / "shot"), "-o", str(tmp_path / "out"), "-D", f"height={SIZE[1]}"),
        *("--rule", "fixed:spp=100", "--workers", "1", "--threads", "1"),
    )
    assert render.exit_code(180) == 0, render.said
    job = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (job["state"], job["variant"], job["spp"]) == ("converged", "toy:plain", 100)
    image = decode_image((tmp_path / "out" / "image.exr").read_bytes())
    assert image.shape == (SIZE[1], SIZE[0], 3)
    # A sample's standard deviation is 0.5/√12, and 115,200 of them were drawn
    assert image.mean() == pytest.approx(0.25, abs=5 * 0.5 / np.sqrt(12 * 100 * image.size))


def test_a_scene_is_checked_and_a_wrong_one_is_refused(start: Start, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "flat.zip", "w") as bundle:
        bundle.writestr("flat.toy", "TOY 24 sixteen")
    render = start("render", str(tmp_path / "flat.zip"))
    assert render.exit_code(60) == 1
    assert "a toy scene is TOY WIDTH HEIGHT" in render.said
    unknown = start("render", str(tmp_path / "flat.zip"), "--variant", "toy:fancy")
    assert unknown.exit_code(60) == 2
    assert "analytic:numpy" in unknown.said
    assert "or toy:plain" in unknown.said


def test_help_lists_and_formats_know_it() -> None:
    program = (
        "from plateau.farm.bundle.formats import formats\n"
        "from plateau.farm.model.spec import JobSpec\n"
        "schema = JobSpec.model_json_schema()['properties']['variant']\n"
        "print(schema['enum'][-1], formats()[-1].called)\n"
    )
    for arguments, says in (
        (("-c", program), "toy:plain a toy scene"),
        (("-m", "plateau", "submit", "--help"), "; toy:plain."),
    ):
        done = subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, "PYTHONPATH": str(TOY)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert says in " ".join(done.stdout.split())
