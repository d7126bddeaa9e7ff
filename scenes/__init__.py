"""The scenes of the paper, built by code: each is a folder, its `build.py` and its `scene.xml`."""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
#: The families: each once under a bright light, as its scene is written, and once under a dim one.
NAMES: Final = ("bar", "box", "oculist", "plants")
