"""Blender files, as far as they are known without Blender.

A file is one of Blender's by its first characters, or compressed by gzip (before Blender 3.0) or
Zstandard (since). What is in it is known to Blender alone, which a worker runs: the size of the
image, the cameras and the frames. A job's parameters may set these.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import IO, Final

from plateau.farm.bundle.check import not_a_scene
from plateau.farm.bundle.formats import Checked, SceneFormat
from plateau.farm.bundle.limits import BundleError, BundleLimits, shown
from plateau.farm.bundle.magic import BEGINNING_BYTES, GZIP, ZSTANDARD, gunzipped, what_it_is
from plateau.farm.bundle.tree import Parts, Tree

_MAGIC: Final = b"BLENDER"
_END_OF_TABLE: Final = b"\xb1\xea\x92\x8f"

#: The parameters that a job may set, with what each has to be.
PARAMETERS: Final = {
    "width": "a whole number of pixels, at least 1",
    "height": "a whole number of pixels, at least 1",
    "frame": "a whole number from -1048574 to 1048574",
    "camera": "the name of a camera of the scene",
}
#: Blender's own bounds of frames (`bpy.types.Scene.frame_current`).
_MOST_FRAME: Final = 1_048_574
_WHOLE: Final = re.compile(r"-?[0-9]{1,8}", re.ASCII)
_MAX_NAME: Final = 255


def _check_blend(
    tree: Tree, entry: Parts, parameters: Mapping[str, str], sensor: int, limits: BundleLimits
) -> Checked:
    """Return the width and height that the parameters set; None for the file's own."""
    with tree.open(entry) as stream:
        _check_beginning(stream)
    for name, value in parameters.items():
        _check(name, value)
    size = [int(parameters[name]) if name in parameters else None for name in ("width", "height")]
    width, height = size
    if (width or 1) * (height or 1) > limits.max_pixels:
        raise BundleError(
            "film-size",
            f"a film of {width or '…'}×{height or '…'} pixels is too large: {limits.max_pixels} "
            "pixels are allowed",
        )
    if sensor != 0:
        raise BundleError(
            "no-sensor",
            f"the scene has no sensor {sensor}; a Blender file has sensor 0 alone, and other "
            "cameras by the parameter camera",
        )
    return Checked(width=width, height=height, sensors=1, parameters={})


BLEND: Final = SceneFormat(
    renderer="cycles",
    kind="blend",
    called="a Blender file",
    media_type="application/x-blender",
    entry="scene.blend",
    begins=(_MAGIC, GZIP, ZSTANDARD),
    check=_check_blend,
    suffix=".blend",
    left_out=re.compile(r"\.blend[0-9]+"),  # what Blender calls a file's earlier versions
    is_compressed=True,
)


def _check_beginning(stream: IO[bytes]) -> None:
    beginning = stream.read(BEGINNING_BYTES)
    is_blend = gunzipped(beginning) if beginning.startswith(GZIP) else beginning
    if beginning.startswith(ZSTANDARD):
        # Blender can jump within such a file, and so ends it with a table of its parts.
        stream.seek(-len(_END_OF_TABLE), os.SEEK_END)
        is_blend = _MAGIC if stream.read() == _END_OF_TABLE else b""
    if not is_blend.startswith(_MAGIC):
        raise not_a_scene(what_it_is(beginning))


def _check(name: str, value: str) -> None:
    if name not in PARAMETERS:
        raise BundleError(
            "unknown-parameter",
            f"a Blender file has no parameter {shown(name)}; it has {', '.join(PARAMETERS)}",
        )
    if name == "camera":
        fits = 0 < len(value) <= _MAX_NAME and value.isprintable()
    else:
        least = -_MOST_FRAME if name == "frame" else 1
        fits = _WHOLE.fullmatch(value) is not None and least <= int(value) <= (
            _MOST_FRAME if name == "frame" else 2**26
        )
    if not fits:
        raise BundleError("bad-parameter", f"{name} must be {PARAMETERS[name]}, not {shown(value)}")
