"""Blender's side: a session without a window sends its file to a real farm, and has the image."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plateau.farm.images.exr import decode_image
from tests.blender.conftest import in_blender
from tests.support.farms.real_farm import RealFarm


@pytest.fixture(scope="module")
def farm(tmp_path_factory, cache) -> Iterator[RealFarm]:
    with RealFarm(tmp_path_factory.mktemp("farm"), cache, plain=True) as farm:
        farm.start("monitor")
        farm.start("worker")
        yield farm


def _session(blend: Path, url: str, **asked: object) -> dict[str, Any]:
    command = in_blender("addon_session", str(blend), json.dumps({"url": url, **asked}))
    with tempfile.TemporaryDirectory() as settings:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": settings}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    assert lines, done.stderr
    assert lines[-1].startswith("{"), done.stdout + done.stderr
    return json.loads(lines[-1])


def test_a_file_is_packed_sent_and_its_image_loaded(farm, blend, tmp_path):
    # Given a file with its texture beside it
    shutil.copytree(blend("textured").parent, tmp_path / "shots")
    shot = tmp_path / "shots" / "shot.blend"
    before = shot.read_bytes()
    # When it is submitted from the panel
    settings = {"rule": "fixed", "cap": 4000, "job": "tiles"}  # some seconds, for its previews
    found = _session(shot, farm.url, settings=settings)
    # Then the image came while it rendered, and the linear one is loaded and saved beside the file
    assert (found["is_over"], found["is_error"]) == (True, False), found
    assert found["text"].startswith("converged: ")
    assert found["previews"] > 0
    assert any("uploading" in text or "spp" in text for text in found["said"])
    result = tmp_path / "shots" / "plateau" / "tiles-0001.exr"
    assert Path(found["path"]) == result
    assert (found["size"], found["is_float"]) == ([64, 48], True)
    image = decode_image(result.read_bytes())
    alpha = 1.0
    assert found["mean"] == pytest.approx((image.mean() * 3 + alpha) / 4, rel=1e-3)
    # And the farm has the job with its texture: the floor is green
    (job,) = farm.client.all_jobs()
    assert (job.name, job.spp, job.variant) == ("tiles", 4000, "cycles:cpu")
    assert np.array_equal(image, farm.image(job))
    red, green, _ = image[-1, 32]
    assert green > 2 * red
    # And nothing was packed into the user's own file
    assert (found["packed"], found["file"]) == ([], str(shot))
    assert shot.read_bytes() == before


def test_a_job_is_cancelled_with_the_image_that_it_has(farm, blend):
    found = _session(blend("plain"), farm.url, cancel=True, settings={"rule": "fixed"})
    assert found["text"].startswith("cancelled"), found
    assert found["path"].endswith(".exr")


@pytest.mark.parametrize(
    ("name", "url", "says"),
    [
        ("eevee", "http://127.0.0.1:9", "set the render engine to it"),
        ("plain", "queue:8713", "looks like http://queue:8713"),
        ("plain", "http://queue.example:8713", "Allow Online Access"),
    ],
)
def test_what_cannot_be_sent_is_said_before_anything_is_saved(blend, name, url, says):
    assert says in _session(blend(name), url)["error"]


def test_an_image_that_is_not_saved_is_named(blend):
    found = _session(blend("plain"), "http://127.0.0.1:9", paint=True)
    assert "not saved: painted" in found["error"]


def test_a_missing_file_and_a_silent_farm_are_said_in_words(blend, tmp_path):
    alone = tmp_path / "shot.blend"
    shutil.copy(blend("textured"), alone)
    found = _session(alone, "http://127.0.0.1:9")
    assert (found["is_over"], found["is_error"]) == (True, True)
    assert f"cannot be packed: {tmp_path}/textures/tiles.png. Save the file in a" in found["text"]
    found = _session(blend("plain"), "http://127.0.0.1:9")
    assert found["text"].startswith("no answer from http://127.0.0.1:9: ")
    assert found["is_error"]


def test_a_farm_that_asks_for_a_key_is_given_the_one_of_the_preferences(farm, blend):
    made = subprocess.run(
        [sys.executable, "-m", "plateau", "keys", "create", "artist"],
        env=farm.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    key = next(word for word in made.stdout.split() if len(word) > 20)
    found = _session(blend("plain"), farm.url)
    assert "the key is in the add-on's preferences" in found["text"], found
    settings = {"rule": "fixed", "cap": 100}
    found = _session(blend("plain"), farm.url, key=key, settings=settings)
    assert found["text"].startswith("converged"), found
