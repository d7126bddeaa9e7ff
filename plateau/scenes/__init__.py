"""The scenes of the paper: a folder each, with `scene.xml`, its meshes and its textures."""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
#: The families, and `intensity` under the bright light, as the scene is written, and the dim one.
LIGHTS: Final = {
    "bar": (80.0, 40.0),
    "box": (20.0, 10.0),
    "oculist": (80.0, 40.0),
    "plants": (24.0, 12.0),
}
NAMES: Final = tuple(LIGHTS)
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
