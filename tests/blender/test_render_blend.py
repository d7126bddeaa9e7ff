"""`plateau render shot.blend`: real processes, and bits that depend on no worker."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from plateau.farm.images.exr import decode_header, decode_image, decode_layers
from tests.blender.conftest import in_blender
from tests.support.processes.commands import Command


def _rendered(scene: Path, out: Path, *options: str) -> dict[str, Any]:
    arguments = ("render", str(scene), "-o", str(out), "--threads", "1", *options)
    with Command(*arguments, folder=out.parent) as command:
        assert command.exit_code(240) == 0, command.said
    return json.loads((out / "summary.json").read_text())


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


def test_passes_of_many_slices_make_up_the_image(blend, tmp_path):
    out = tmp_path / "out"
    found = _rendered(blend("passes"), out, *("--workers", "2", "--spp", "100", "--aov", "depth"))
    assert any("Shadow Catcher" in note for note in found["notes"])
    content = (out / "image.exr").read_bytes()
    image, header = decode_layers(content), decode_header(content)
    # Compositors find its Cryptomattes, by the specification's names
    named = {value for name, value in header.items() if name.endswith("/name")}
    assert named >= {"K_che.CryptoObject", "K_che.CryptoMaterial", "K_che.CryptoAsset"}
    assert any("glowing" in json.loads(v) for n, v in header.items() if n.endswith("/manifest"))
    assert image["K_che.CryptoObject00.g"].max() == 1
    made = image["K_che.Emission.R"] + image["K_che.Environment.R"]
    made = made + image["K_che.Volume Direct.R"] + image["K_che.Volume Indirect.R"]
    for kind in ("Diffuse", "Glossy", "Transmission"):
        light = image[f"K_che.{kind} Direct.R"] + image[f"K_che.{kind} Indirect.R"]
        made = made + image[f"K_che.{kind} Color.R"] * light
    assert np.abs(made - image["R"]).max() < 2e-5
    # Depth is the first sample's: far away where there is nothing, and else less than the distance
    nothing = image["K_che.Depth.Z"] > 1e9
    assert (image["Z"][nothing] == 0).all()
    assert (image["Z"][~nothing] >= image["K_che.Depth.Z"][~nothing] - 1e-4).all()
    assert set(np.unique(image["K_che.Object Index.X"])) <= {0, 3, 4, 5}


@pytest.mark.parametrize("denoiser", ["none", "oidn"])
@pytest.mark.parametrize(("name", "words"), [("plain", "(AgX)"), ("filmic", "(Filmic, look High")])
def test_it_is_seen_through_the_view_transform_of_the_scene(blend, tmp_path, name, words, denoiser):
    out = tmp_path / "out"
    found = _rendered(blend(name), out, "--spp", "100", "--max-spp", "100", "--denoise", denoiser)
    assert any(words in note for note in found["notes"])
    # Blender shows the linear image that was delivered alike, to two code values of 255
    picture = tmp_path / "blender.png"
    shown = in_blender(
        "scene_files", "show", str(blend(name)), str(out / "image.exr"), str(picture)
    )
    subprocess.run(shown, check=True, capture_output=True)
    ours, theirs = (
        np.asarray(Image.open(one).convert("RGB")).astype(int)
        for one in (out / "image.png", picture)
    )
    assert np.abs(ours - theirs).max() <= 2
    assert len(np.unique(ours)) > 50


def test_a_folder_is_sent_with_its_textures_and_converges(blend, tmp_path):
    folder = tmp_path / "room"
    shutil.copytree(blend("textured").parent, folder)
    found = _rendered(
        folder, tmp_path / "out", "-D", "camera=above", "--rule", "visible:target=0.005"
    )
    assert found["state"] == "converged"
    red, green, _ = decode_image((tmp_path / "out" / "image.exr").read_bytes())[0, 0]
    assert green > 3 * red
