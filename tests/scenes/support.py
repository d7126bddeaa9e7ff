"""What the families' tests share: the files that are checked in, and what Mitsuba makes of them."""

import io
import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

_RENDER = """
import json, sys
import mitsuba as mi, numpy as np
mi.set_variant("scalar_rgb")
scene = mi.load_file(sys.argv[1], width=32, height=32, intensity=sys.argv[2])
brightest = np.array(mi.render(scene, spp=64)).max(axis=2)
faces = [shape.face_count() for shape in scene.shapes() if shape.is_mesh()]
facts = float(np.median(brightest)), float((brightest > 1).mean()), len(scene.shapes()), sum(faces)
print("\\n" + json.dumps(facts))
"""


@dataclass(frozen=True)
class Facts:
    """What a scene is once Mitsuba has loaded and rendered it, small, at EV 0."""

    #: of each pixel's brightest channel
    median: float
    #: share of pixels beyond white
    clipped: float
    shapes: int
    faces: int


def facts(scene: Path, intensity: float) -> Facts:
    """Return what `scalar_rgb` makes of a scene at 32 × 32 pixels and 64 spp."""
    process = subprocess.run(
        [sys.executable, "-c", _RENDER, str(scene), str(intensity)],
        capture_output=True,
        text=True,
        check=True,
    )
    return Facts(*json.loads(process.stdout.splitlines()[-1]))


def assert_checked_in(folder: Path, built: Mapping[str, bytes]) -> None:
    """Fail unless the folder's scene, meshes and textures are those that were built.

    Pictures are compared by their pixels, give or take one level: libraries pack PNG in various
    ways, and machines round a sine in various ways.
    """
    present = {"scene.xml"} | {
        path.relative_to(folder).as_posix()
        for kind in ("meshes", "textures")
        for path in (folder / kind).glob("*")
    }
    assert present == set(built)
    for name, content in built.items():
        if name.endswith(".png"):
            apart = pixels((folder / name).read_bytes()) - pixels(content)
            assert np.abs(apart).max() <= 1, f"build it again: {name}"
        else:
            assert (folder / name).read_bytes() == content, f"build it again: {name}"


def pixels(png: bytes) -> np.ndarray:
    """Return a PNG's levels (those of its palette) as integers, which can be subtracted."""
    with Image.open(io.BytesIO(png)) as image:
        shown = image.convert("RGB") if image.mode == "P" else image
        return np.asarray(shown).astype(int)
