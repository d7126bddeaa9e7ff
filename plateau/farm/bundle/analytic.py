"""The format of analytic scenes: a JSON file that names an image and the noise of a sample.

::

    {"analytic": 1, "width": 64, "height": 48, "light": "checks", "noise": "gaussian", "level": 0.5}

``analytic`` is the version of the format. `AnalyticScene` has the defaults of all other fields. A
job's parameter replaces the field of its name. `plateau.worker.renderers.analytic` says what the
fields mean in pixels.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import IO, Any, Final

from plateau.farm.bundle.formats import Checked, SceneFormat
from plateau.farm.bundle.limits import BundleError, BundleLimits, shown
from plateau.farm.bundle.tree import Parts, Tree

LIGHTS: Final = ("grey", "ramp", "checks", "texture")
NOISES: Final = ("gaussian", "heavy-tailed", "filtered", "fireflies")

_VERSION: Final = 1
_MOST_BYTES: Final = 2**16
_MOST_LEVEL: Final = 1e6


@dataclass(frozen=True, kw_only=True)
class AnalyticScene:
    """A known image, and noise of known statistics upon it."""

    #: of the film, in pixels
    width: int = 64
    height: int = 64
    #: one of `LIGHTS`: the converged image, without the fireflies of that noise
    light: str = "checks"
    #: one of `NOISES`: the distribution of a sample about that image
    noise: str = "gaussian"
    #: standard deviation of a sample, 0 or more: a multiple of the pixel's light, or a radiance
    #: where `additive`; fireflies have a brightness of their own
    level: float = 0.5
    #: whether dark pixels have as much noise as bright ones
    additive: bool = False
    #: whether the film has alpha: opaque in the middle, then half transparent, empty at the edge
    alpha: bool = False

    def as_text(self) -> dict[str, str]:
        """Return the fields as the text of job parameters."""
        return {
            name: value if isinstance(value, str) else json.dumps(value)
            for name, value in asdict(self).items()
        }


_FIELDS: Final = {one.name: type(one.default) for one in fields(AnalyticScene)}
_KNOWN: Final = f"an analytic scene has {', '.join(_FIELDS)}"


def read_analytic_scene(
    stream: IO[bytes], parameters: Mapping[str, str], limits: BundleLimits
) -> tuple[AnalyticScene, dict[str, str]]:
    """Return the scene of a file with a job's parameters, and the file's own fields as text.

    Raises
    ------
    BundleError
        The file is no analytic scene, or a field has a value that it cannot have.
    """
    stated = _object(stream.read(_MOST_BYTES + 1))
    if stated.pop("analytic", None) != _VERSION:
        raise BundleError(
            "not-a-scene",
            f'the file is JSON, and no analytic scene: such a one has "analytic": {_VERSION}',
        )
    for name in stated:
        if name not in _FIELDS:
            raise BundleError("analytic-field", f"there is no field {shown(name)}; {_KNOWN}")
    own = _scene(stated, limits)
    for name in parameters:
        if name not in _FIELDS:
            raise BundleError(
                "unknown-parameter", f"the scene does not use a parameter {shown(name)}; {_KNOWN}"
            )
    given = {name: _from_text(name, text) for name, text in parameters.items()}
    return _scene({**stated, **given}, limits), own.as_text()


def _check(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    with tree.open(entry) as stream:
        scene, own = read_analytic_scene(stream, parameters, limits)
    if sensor != 0:
        raise BundleError(
            "no-sensor", f"the scene has no sensor {sensor}; an analytic one has sensor 0 alone"
        )
    return Checked(width=scene.width, height=scene.height, sensors=1, parameters=own)


ANALYTIC_JSON: Final = SceneFormat(
    renderer="analytic",
    kind="json",
    called="an analytic scene",
    media_type="application/json",
    entry="scene.json",
    begins=(b"{",),
    check=_check,
)


def _object(content: bytes) -> dict[str, Any]:
    if len(content) > _MOST_BYTES:
        raise BundleError("too-large", f"an analytic scene has at most {_MOST_BYTES} bytes")
    try:
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise BundleError(
            "not-a-scene", f"the file begins as JSON does, and is none: {error}"[:300]
        ) from error
    return document if isinstance(document, dict) else {}


def _from_text(name: str, text: str) -> Any:
    """Return a job's parameter with its field's type; the check refuses text of no such type."""
    if _FIELDS[name] is str:
        return text
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def _scene(values: Mapping[str, Any], limits: BundleLimits) -> AnalyticScene:
    for name, value in values.items():
        if not _fits(name, value):
            raise BundleError("analytic-field", f"{name} {_WANTED[name]}, not {shown(str(value))}")
    level = {"level": float(values["level"])} if "level" in values else {}
    scene = AnalyticScene(**{**values, **level})
    if scene.width * scene.height > limits.max_pixels:
        raise BundleError(
            "film-size",
            f"a film of {scene.width}×{scene.height} pixels is too large: {limits.max_pixels} "
            "pixels are allowed",
        )
    return scene


def _fits(name: str, value: Any) -> bool:
    if name in ("width", "height"):
        return type(value) is int and value >= 1
    if name == "level":
        return type(value) in (int, float) and 0 <= value <= _MOST_LEVEL
    if name in ("additive", "alpha"):
        return type(value) is bool
    return value in {"light": LIGHTS, "noise": NOISES}[name]


_WANTED: Final = {
    "width": "must be a whole number of at least 1",
    "height": "must be a whole number of at least 1",
    "light": f"must be one of {', '.join(LIGHTS)}",
    "noise": f"must be one of {', '.join(NOISES)}",
    "level": f"must be a number from 0 to {_MOST_LEVEL:g}",
    "additive": "must be true or false",
    "alpha": "must be true or false",
}
