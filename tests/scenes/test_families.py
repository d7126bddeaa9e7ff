"""What holds for every scene of our own."""

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from plateau import scenes
from plateau.farm.bundle import inspect_bundle
from plateau.files.packing import pack
from plateau.scenes.build import write_files
from tests.scenes.support import assert_checked_in

MOST_BYTES = 2_000_000


def build(family: str) -> Any:
    return import_module(f"plateau.scenes.{family}.build")


@cache
def files(family: str) -> dict[str, bytes]:
    """What the family's code builds, which takes a second or two."""
    found: dict[str, bytes] = build(family).files()
    return found


def test_every_family_has_a_name() -> None:
    assert {path.parent.name for path in scenes.FOLDER.glob("*/scene.xml")} == set(scenes.NAMES)


def test_it_is_written_elsewhere_too(tmp_path: Path) -> None:
    write_files(tmp_path, files("box"))
    assert_checked_in(tmp_path, files("box"))


@pytest.mark.parametrize("family", scenes.NAMES)
class TestEveryFamily:
    def test_is_checked_in_as_its_code_builds_it(self, family: str) -> None:
        assert_checked_in(scenes.FOLDER / family, files(family))

    def test_passes_the_farms_check(self, family: str) -> None:
        given = {"width": "128", "intensity": "3"}
        with pack(scenes.FOLDER / family) as packed:
            summary = inspect_bundle(packed.file, parameters=given)
        assert (summary.entry, summary.sensors) == ("scene.xml", 1)
        assert (summary.width, summary.height) == (128, 512)
        assert summary.files == len(files(family))
        assert summary.bytes_unpacked < MOST_BYTES
        assert summary.parameters["width"] == summary.parameters["height"] == "512"
        assert summary.parameters["intensity"] == f"{build(family).BRIGHT:g}"
        assert set(summary.parameters) == {"width", "height", "intensity", "max_depth"}

    def test_is_in_the_readme_with_both_lights(self, family: str) -> None:
        assert build(family).DIM == build(family).BRIGHT / 2
        readme = (scenes.FOLDER / "README.md").read_text(encoding="utf-8")
        for number, intensity in ((1, build(family).BRIGHT), (2, build(family).DIM)):
            assert f"| {family.upper()} {number} | {intensity:g} |" in readme
