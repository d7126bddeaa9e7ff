"""`plateau render` of a Blender file on a machine without Blender."""

import sys
from pathlib import Path

import pytest

from plateau.errors import CommandFailed
from plateau.farm.model.spec import JobSpec
from plateau.rendering.own_farm import checked_settings


def test_it_says_what_to_install_before_anything_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "shot.blend"
    path.write_bytes(b"BLENDER17-01v0501")
    monkeypatch.setitem(sys.modules, "bpy", None)
    with pytest.raises(CommandFailed, match=r"with cycles:cpu.*pip install 'plateau\[blender\]'"):
        checked_settings(path, JobSpec())
    with pytest.raises(CommandFailed, match=r"renderer cycles, which has no variant scalar_rgb"):
        checked_settings(path, JobSpec(variant="scalar_rgb"))
