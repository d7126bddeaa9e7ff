"""Blender files, made by Blender itself: its Python module, or the program on the PATH."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from plateau.worker.renderers.program import command, program_of

ROOT = Path(__file__).parents[2]
VARIANT = "cycles:cpu"


def in_blender(module: str, *arguments: str) -> list[str]:
    """The command that runs a module of these tests where Blender's Python module is."""
    whole = command(VARIANT, f"tests.blender.{module}", arguments)
    if program_of(VARIANT) is not None:
        whole.insert(whole.index("--") + 2, str(ROOT))  # among the folders of packages
    return whole


@pytest.fixture(scope="session")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The Blender file of a name in `scene_files`, each in a folder of its own."""
    made: dict[str, Path] = {}

    def of(name: str) -> Path:
        if name not in made:
            path = tmp_path_factory.mktemp(name) / "shot.blend"
            made_by = in_blender("scene_files", name, str(path))
            done = subprocess.run(made_by, capture_output=True, text=True, check=False)
            assert path.is_file(), done.stdout + done.stderr
            made[name] = path
        return made[name]

    return of
