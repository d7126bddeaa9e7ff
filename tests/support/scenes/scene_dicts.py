"""Scenes as Mitsuba dicts, for a process that has Mitsuba."""

import contextlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from plateau.farm.bundle import BundleError


def scene_dict() -> dict[str, Any]:
    """A scene with a value of each kind that is in memory alone."""
    import mitsuba as mi

    random = np.random.default_rng(1)

    def values(*shape: int) -> "np.ndarray[Any, Any]":
        return random.random(shape).astype(np.float32)

    def diffuse(**texture: object) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": {"type": "bitmap", **texture}}

    fog = {"type": "gridvolume", "data": mi.TensorXf(values(4, 4, 4, 1))}
    return {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 4},
        "sensor": {
            "type": "perspective",
            "fov": np.float32(40),
            "to_world": mi.Transform4f().look_at(origin=[2, 2, 4], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": np.int64(24),
                "height": 16,
                "filter": {"type": "box"},
            },
        },
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(values(8, 16, 3))},
        "floor": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().translate([0, -1, 0]).rotate([1, 0, 0], -90),
            "bsdf": diffuse(data=mi.TensorXf(values(8, 8, 3)), filter_type="nearest"),
        },
        "cube": mi.load_dict({"type": "cube"}),
        "red": {"type": "diffuse", "reflectance": {"type": "rgb", "value": np.array([0.8, 0, 0])}},
        "ball": {
            "type": "sphere",
            "center": np.array([1.5, 0, 0]),
            "radius": np.float64(0.5),
            "bsdf": {"type": "ref", "id": "red"},
        },
        "marble": {
            "type": "sphere",
            "center": mi.ScalarPoint3f(-1.5, 0, 0),
            "radius": 0.5,
            "bsdf": diffuse(bitmap=mi.Bitmap((255 * values(8, 8, 3)).astype(np.uint8))),
        },
        "cloud": {
            "type": "cube",
            "to_world": mi.ScalarTransform4f().translate([0, 1.5, 0]).scale(0.5),
            "bsdf": {"type": "null"},
            "interior": {"type": "heterogeneous", "sigma_t": fog, "albedo": 0.5},
        },
    }


def images_of_dict_and_file() -> tuple["np.ndarray[Any, Any]", "np.ndarray[Any, Any]"]:
    """The image of the scene as Mitsuba loads it, and as it loads what was written of it."""
    import mitsuba as mi

    from plateau.worker.renderers.mitsuba.scene_dict import write_scene_dict

    with tempfile.TemporaryDirectory() as folder:
        scenes = [
            mi.load_dict(scene_dict()),
            mi.load_file(str(write_scene_dict(scene_dict(), Path(folder)))),
        ]
    first, second = (np.array(mi.render(scene, spp=16, seed=1)) for scene in scenes)
    return first, second


def files_of_dict() -> dict[str, bytes]:
    """What is written of the scene, by its place."""
    from plateau.worker.renderers.mitsuba.scene_dict import write_scene_dict

    with tempfile.TemporaryDirectory() as folder:
        top = write_scene_dict(scene_dict(), Path(folder)).parent
        return {
            str(path.relative_to(top)): path.read_bytes()
            for path in sorted(top.rglob("*"))
            if path.is_file()
        }


#: Values of a sphere that cannot be written, and what is said of each.
REFUSED: dict[str, Callable[[], object]] = {
    "x.value is None": lambda: None,
    "x.value is a set": lambda: {1},
    "x.value is <built-in function print>, which": lambda: print,
    "x.value is a Mitsuba object (SmoothConductor)": lambda: _loaded({"type": "conductor"}),
    "x.value is a mesh with a BSDF of its own": lambda: _loaded(
        {"type": "cube", "bsdf": {"type": "conductor"}}
    ),
    "x.value is a mesh with an emitter": lambda: _loaded(
        {"type": "rectangle", "emitter": {"type": "area"}}
    ),
    "x.value.data is a tensor, and 'sphere'": lambda: {"type": "sphere", "data": [1.0]},
    "x.value names the folder 'nowhere', which is not there": (
        lambda: {"type": "resources", "path": "nowhere"}
    ),
}


def refusal(said: str) -> str:
    """What is said of a scene with this value."""
    from plateau.worker.renderers.mitsuba.scene_dict import write_scene_dict

    scene = {"type": "scene", "x": {"type": "sphere", "value": REFUSED[said]()}}
    with tempfile.TemporaryDirectory() as folder:
        try:
            write_scene_dict(scene, Path(folder))
        except BundleError as error:
            return f"{error.code}: {error}"
    return "nothing"


def picture_by_resources(folder: Path, *, absolute: bool, first: bool) -> str:
    """The name in the written XML of a picture that is in the dict's resources."""
    import mitsuba as mi

    mi.Bitmap(np.full((2, 2, 3), 128, np.uint8)).write(str(folder / "there" / "i.png"))
    resources = {"type": "resources", "path": str(folder / "there") if absolute else "there"}
    parts = [("a", resources), ("b", _WITH_PICTURE)][:: 1 if first else -1]
    with contextlib.chdir(folder):
        return _picture_of(dict(parts))


_WITH_PICTURE: Final = {
    "type": "sphere",
    "bsdf": {"type": "diffuse", "reflectance": {"type": "bitmap", "filename": "i.png"}},
}


def _picture_of(parts: dict[str, Any]) -> str:
    from plateau.worker.renderers.mitsuba.scene_dict import write_scene_dict

    with tempfile.TemporaryDirectory() as out:
        written = write_scene_dict({"type": "scene", **parts}, Path(out))
        return next(iter(written.parent.rglob("*.png"))).name


def _loaded(scene: dict[str, Any]) -> object:
    import mitsuba as mi

    return mi.load_dict(scene)
