"""A picture of where people look becomes the weights of a focus."""

from pathlib import Path

import numpy as np
import pytest

from plateau.errors import CommandFailed
from plateau.farm.images.png import encode_png
from plateau.files.focus_map import focus_of
from tests.support.images.plain_exr import encode_image


def written(path: Path, grey: np.ndarray) -> Path:
    colour = np.repeat(grey[..., np.newaxis], 3, axis=-1)
    if path.suffix == ".exr":
        path.write_bytes(encode_image(colour.astype(np.float32), {}))
    else:
        path.write_bytes(encode_png(colour.astype(np.uint8)))
    return path


def test_a_small_picture_is_taken_as_it_is(tmp_path: Path) -> None:
    grey = np.array([[0, 51, 255], [0, 0, 102]])
    assert focus_of(written(tmp_path / "a.png", grey)) == [[0, 0.2, 1], [0, 0, 0.4]]
    assert focus_of(written(tmp_path / "a.exr", grey / 17)) == [[0, 0.2, 1], [0, 0, 0.4]]


def test_a_large_one_is_averaged(tmp_path: Path) -> None:
    grey = np.zeros((100, 641))
    grey[:, 320:] = 200
    weights = np.array(focus_of(written(tmp_path / "a.png", grey)))
    assert weights.shape == (32, 32)
    assert weights[:, :15].max() == 0
    assert weights[:, 17:].min() == 1


@pytest.mark.parametrize(
    ("name", "grey", "words"),
    [
        ("a.png", np.zeros((4, 4)), "is black"),
        ("a.exr", np.full((4, 4), -1.0), "negative"),
        ("a.exr", np.full((4, 4), np.nan), "NaN"),
    ],
)
def test_what_is_no_focus_is_refused(
    tmp_path: Path, name: str, grey: np.ndarray, words: str
) -> None:
    with pytest.raises(CommandFailed, match=words):
        focus_of(written(tmp_path / name, grey))


def test_so_is_what_is_no_picture(tmp_path: Path) -> None:
    for name in ("a.png", "a.exr"):
        (tmp_path / name).write_text("a picture")
        with pytest.raises(CommandFailed, match=f"{name} cannot be read") as refused:
            focus_of(tmp_path / name)
    assert str(refused.value).endswith("it is not an EXR file")
