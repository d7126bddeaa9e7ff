"""A scene given as a Mitsuba dict becomes files, of which Mitsuba renders the same image."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.support.processes.mitsuba_process import MitsubaProcess
from tests.support.scenes import scene_dicts


def test_the_written_scene_has_the_same_image(scalar: MitsubaProcess) -> None:
    of_dict, of_file = scalar.call(scene_dicts.images_of_dict_and_file)
    assert of_dict.std() > 0.05
    # The writer turns matrices into rotations and scales, which moves the last bits
    assert np.allclose(of_dict, of_file, atol=1e-3)


def test_the_same_dict_gives_the_same_files(scalar: MitsubaProcess) -> None:
    files = scalar.call(scene_dicts.files_of_dict)
    assert [name.rpartition(".")[2] for name in files] == ["vol", "ply", "xml", "exr", "exr", "png"]
    assert scalar.call(scene_dicts.files_of_dict) == files


@pytest.mark.parametrize("said", scene_dicts.REFUSED)
def test_what_cannot_be_written_is_named(scalar: MitsubaProcess, said: str) -> None:
    assert said in scalar.call(scene_dicts.refusal, said)
    assert scalar.call(scene_dicts.refusal, said).startswith("unwritable-dict: ")


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("first", [False, True])
def test_files_are_found_in_its_resources(
    scalar: MitsubaProcess, tmp_path: Path, absolute: bool, first: bool
) -> None:
    (tmp_path / "there").mkdir()
    picture = partial(scene_dicts.picture_by_resources, absolute=absolute, first=first)
    assert scalar.call(picture, tmp_path) == "i.png"
