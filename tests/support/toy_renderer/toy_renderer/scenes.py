"""The format of toy scenes: one line, ``TOY WIDTH HEIGHT``."""

from plateau.farm.bundle.formats import Checked, SceneFormat
from plateau.farm.bundle.limits import BundleError


def size_in(line, parameters):
    """Return the width and height of a scene, as bytes have it, with a job's parameters."""
    words = line.split()
    if len(words) != 3 or not all(word.isdigit() for word in words[1:]):
        raise BundleError("not-a-scene", "a toy scene is TOY WIDTH HEIGHT")
    if unknown := parameters.keys() - {"width", "height"}:
        raise BundleError("unknown-parameter", f"a toy scene has no {', '.join(unknown)}")
    width, height = map(int, words[1:])
    return int(parameters.get("width", width)), int(parameters.get("height", height))


def _check(tree, entry, parameters, sensor, limits):
    with tree.open(entry) as stream:
        width, height = size_in(stream.read(100), parameters)
    if width * height > limits.max_pixels:
        raise BundleError("film-size", "a toy scene of too many pixels")
    if sensor:
        raise BundleError("no-sensor", "a toy scene has sensor 0 alone")
    return Checked(width=width, height=height, sensors=1, parameters={})


TOY_FILE = SceneFormat(
    renderer="toy",
    kind="toy",
    called="a toy scene",
    media_type="text/plain",
    entry="scene.toy",
    begins=(b"TOY",),
    check=_check,
    suffix=".toy",
)
