"""`plateau render shot.blend`: real processes, and bits that depend on no worker."""

import json
import shutil
from pathlib import Path

import numpy as np

from plateau.farm.images.exr import decode_image
from tests.support.commands import Command


def _rendered(scene: Path, out: Path, *options: str) -> dict[str, object]:
    arguments = ("render", str(scene), "-o", str(out), "--threads", "1", *options)
    command = Command(*arguments, folder=out.parent)
    try:
        assert command.exit_code(240) == 0, command.said
    finally:
        command.end()
    summary: dict[str, object] = json.loads((out / "summary.json").read_text())
    return summary


def test_the_image_does_not_depend_on_the_workers(blend, tmp_path):
    images = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        found = _rendered(blend("plain"), out, "--workers", workers, "--spp", "200")
        assert (found["variant"], found["spp"]) == ("cycles:cpu", 200)
        assert (found["width"], found["height"]) == (64, 48)
        images.append((out / "image.exr").read_bytes())
    one, other = map(decode_image, images)
    assert np.array_equal(one, other)
    assert one.mean() > 0.01


def test_a_folder_is_sent_with_its_textures_and_converges(blend, tmp_path):
    folder = tmp_path / "room"
    shutil.copytree(blend("textured").parent, folder)
    found = _rendered(
        folder, tmp_path / "out", "-D", "camera=above", "--rule", "visible:target=0.005"
    )
    assert found["state"] == "converged"
    red, green, _ = decode_image((tmp_path / "out" / "image.exr").read_bytes())[0, 0]
    assert green > 3 * red
