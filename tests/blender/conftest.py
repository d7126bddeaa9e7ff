"""Blender files, made by Blender's Python module itself."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

MAKER = Path(__file__).parent / "scene_files.py"


@pytest.fixture(scope="session")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The Blender file of a name in `scene_files`, each in a folder of its own."""
    made: dict[str, Path] = {}

    def of(name: str) -> Path:
        if name not in made:
            path = tmp_path_factory.mktemp(name) / "shot.blend"
            command = [sys.executable, str(MAKER), name, str(path)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert path.is_file(), done.stdout + done.stderr
            made[name] = path
        return made[name]

    return of
