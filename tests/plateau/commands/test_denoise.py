"""`plateau denoise`: renders that somebody has already."""

import json
from pathlib import Path

import numpy as np
import pytest

from plateau.farm.images.crops import CROP
from plateau.farm.images.exr import decode_header, decode_layers, encode_layers
from tests.support.processes.commands import plateau

SIZE = (48, 64)
NORMAL = {"N.X": 0.0, "N.Y": 0.0, "N.Z": 1.0}


def light() -> np.ndarray:
    row = np.linspace(0.2, 0.7, SIZE[1], dtype=np.float32)
    return np.repeat(np.tile(row, (SIZE[0], 1))[..., np.newaxis], 3, axis=-1)


def colour(layers: dict[str, np.ndarray], layer: str = "") -> np.ndarray:
    return np.stack([layers[f"{layer}{name}"] for name in "RGB"], axis=-1)


def error(image: np.ndarray) -> float:
    return float(np.square(image - light()).mean())


def renders(folder: Path, count: int, *, guided: bool = False) -> list[Path]:
    files = []
    for seed in range(count):
        noise = np.random.default_rng(seed).normal(0, 0.1, (*SIZE, 3)).astype(np.float32)
        planes = {name: (light() + noise)[..., plane] for plane, name in enumerate("RGB")}
        if guided:
            planes |= {f"albedo.{name}": np.full(SIZE, 0.5, np.float32) for name in "RGB"}
            planes |= {name: np.full(SIZE, value, np.float32) for name, value in NORMAL.items()}
        files.append(folder / f"{seed}.exr")
        files[-1].write_bytes(encode_layers(planes, {}))
    return files


@pytest.mark.parametrize("count", [2, 3])
def test_renders_become_a_clean_one_and_a_figure(tmp_path: Path, count: int) -> None:
    out = tmp_path / "clean.exr"
    code, said, _ = plateau("denoise", *renders(tmp_path, count), "-o", out)
    assert code == 0
    assert "Open Image Denoise" in said
    assert "noise left: " in said
    found = decode_layers(out.read_bytes())
    assert error(colour(found)) < 0.2 * error(colour(found, "raw."))
    assert 0 <= found["denoised.weight"].min() <= found["denoised.weight"].max() <= 1


def test_a_crop_stays_where_it_lies_in_its_film(tmp_path: Path) -> None:
    files = renders(tmp_path, 2)
    for file in files:
        file.write_bytes(encode_layers(decode_layers(file.read_bytes()), {CROP: "3 4 96 64"}))
    assert plateau("denoise", *files, "-o", tmp_path / "clean.exr")[0] == 0
    header = decode_header((tmp_path / "clean.exr").read_bytes())
    assert (header[CROP], header["dataWindow"][0].tolist()) == ("3 4 96 64", [3, 4])


def lose(file: Path, pixels: int, to: Path) -> None:
    planes = decode_layers(file.read_bytes())
    planes["G"][0, :pixels] = np.nan
    to.write_bytes(encode_layers(planes, {}))


def test_pixels_that_are_no_numbers_are_counted_and_their_file_is_named(tmp_path: Path) -> None:
    one, other = renders(tmp_path, 2)
    lose(other, 2, other)
    code, said, _ = plateau("denoise", one, other, "-o", tmp_path / "clean.exr")
    assert code == 0
    assert f"left out: {other}: 2 of 3,072 pixels (0.0651 %) are NaN" in said


def test_albedo_and_normals_guide_it_where_all_have_them(tmp_path: Path) -> None:
    files, out = renders(tmp_path, 2, guided=True), tmp_path / "clean.exr"
    assert json.loads(plateau("denoise", *files, "-o", out, "--json")[1])["guides"]
    files[0] = renders(tmp_path, 1)[0]
    assert not json.loads(plateau("denoise", *files, "-o", out, "--json")[1])["guides"]


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        (["0"], "give two images or more"),
        (["0", "none"], "none.exr: No such file"),
        (["0", "broken"], "broken.exr: the EXR file is damaged"),
        (["0", "small"], "differ in size: 4×4, 64×48"),
        (["0", "1", "again"], "0.exr and "),
        (["0", "lost"], "lost.exr: 5 of 3,072 pixels (0.163 %) are NaN: at most 3 may be"),
        (["0", "clean"], "would overwrite an image that is read"),
    ],
)
def test_what_cannot_be_denoised_is_refused_in_words(
    tmp_path: Path, chosen: list[str], words: str
) -> None:
    files = renders(tmp_path, 3)
    (tmp_path / "again.exr").write_bytes(files[0].read_bytes())
    lose(files[2], 5, tmp_path / "lost.exr")
    (tmp_path / "broken.exr").write_bytes(b"\x76\x2f\x31\x01 and then nothing")
    small = {name: np.zeros((4, 4), np.float32) for name in "RGB"}
    (tmp_path / "small.exr").write_bytes(encode_layers(small, {}))
    out = tmp_path / "clean.exr"
    code, _, said = plateau("denoise", *(tmp_path / f"{name}.exr" for name in chosen), "-o", out)
    assert code == 1
    assert words in said
    assert not out.exists()
