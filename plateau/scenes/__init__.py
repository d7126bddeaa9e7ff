"""The scenes of the paper, built by code: each is a folder, its `build.py` and its `scene.xml`."""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
#: The families: each once under a bright light, as its scene is written, and once under a dim one.
NAMES: Final = ("bar", "box", "oculist", "plants")
_SCHEME: Final = "scenes:"


def path_of(given: str | Path) -> Path:
    """The path of a scene, which may be an example scene, such as `scenes:box`.

    Raises `ValueError` for an example that does not exist.
    """
    name = str(given).removeprefix(_SCHEME)
    if name == str(given):
        return Path(given)
    if name not in NAMES:
        known = ", ".join(f"{_SCHEME}{one}" for one in NAMES)
        raise ValueError(f"there is no {given}; there are {known}")
    return FOLDER / name
