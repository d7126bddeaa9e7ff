"""Renders the frames of a shot by Mitsuba, in a process of its own.

`python -m bench.support.bare.shot_child SHOT FRAMES FOLDER` writes FOLDER/FRAME.npz for each frame
that is not there yet: slices of a few spp, (slices, H, W, 3) float32, with seeds of their own and
with those of every other frame; and an independent reference. With a fourth argument it writes so
many slices with seeds of their own alone, and with a fifth a reference of so many long passes.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

WIDTH, HEIGHT, FPS = 256, 144, 24
#: A frame is this many slices, each of so many samples per pixel.
SLICES, SLICE_SPP = 8, 8
REFERENCE_PASSES, REFERENCE_SPP = 4, 128
#: What moves: the camera, the ball, or the lamp.
SHOTS = ("camera", "object", "light")
#: A board slides below the lamp, so that the last frames are noisier.
UNEVEN = "board"
#: Of one pass of a deep reference.
DEEP_SPP = 256
#: The first seeds: of slices that differ from frame to frame, and of references.
_OWN, _REFERENCE, _DEEP = 1_000, 1_000_000, 5_000_000


def main() -> None:
    shot, frames, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    slices = int(sys.argv[4]) if len(sys.argv) > 4 else SLICES
    deep = int(sys.argv[5]) if len(sys.argv) > 5 else 0
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(frames):
        file = folder / f"{frame:03}.npz"
        if file.exists():
            continue
        scene = mi.load_dict(room(shot, frame / FPS))

        def rendered(seed: int, spp: int, scene: Any = scene) -> Any:
            return np.array(mi.render(scene, spp=spp, seed=seed), np.float32)

        own = _OWN + frame * slices
        images: dict[str, Any] = {
            "own": np.stack([rendered(own + i, SLICE_SPP) for i in range(slices)])
        }
        passes = range(
            _REFERENCE + frame * REFERENCE_PASSES, _REFERENCE + (frame + 1) * REFERENCE_PASSES
        )
        if len(sys.argv) == 4:
            images["same"] = np.stack([rendered(i, SLICE_SPP) for i in range(slices)])
            reference = [rendered(seed, REFERENCE_SPP) for seed in passes]
            images["reference"] = np.mean(reference, axis=0)
        if deep:
            seeds = range(_DEEP + frame * deep, _DEEP + (frame + 1) * deep)
            total = sum(rendered(seed, DEEP_SPP).astype(np.float64) for seed in seeds)
            images["reference"] = (total / deep).astype(np.float32)
        part = file.with_suffix(".part")
        with part.open("wb") as out:
            np.savez(out, **images)
        part.rename(file)


def room(shot: str, time_s: float) -> dict[str, Any]:
    """Return a room with a lamp, a ball and a cube, as it is at this time of the shot."""
    import mitsuba as mi

    def diffuse(red: float, green: float, blue: float) -> dict[str, Any]:
        return {
            "type": "diffuse",
            "reflectance": {"type": "rgb", "value": [red, green, blue]},
        }

    def wall(at: list[float], axis: list[float], degrees: float, bsdf: Any) -> dict[str, Any]:
        place = mi.ScalarTransform4f().translate(at).rotate(axis, degrees).scale([1.8, 1.8, 1])
        return {"type": "rectangle", "to_world": place, "bsdf": bsdf}

    moved = {name: time_s if name == shot else 0.0 for name in (*SHOTS, UNEVEN)}
    eye = [-0.3 + 0.35 * moved["camera"], 0.1, 4.2]
    ball = [-0.7 + 0.8 * moved["object"], -0.6, 0.3 + 0.2 * math.sin(3 * moved["object"])]
    lamp = [-0.6 + 0.7 * moved["light"], 0.98, 0.2]
    tiles = {
        "type": "checkerboard",
        "color0": {"type": "rgb", "value": [0.25, 0.2, 0.15]},
        "color1": {"type": "rgb", "value": [0.7, 0.65, 0.6]},
        "to_uv": mi.ScalarTransform4f().scale([9, 9, 1]),
    }
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 5},
        "sensor": {
            "type": "perspective",
            "fov": 45,
            "to_world": mi.ScalarTransform4f().look_at(eye, [0, -0.1, 0], [0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": WIDTH,
                "height": HEIGHT,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
            },
            "sampler": {"type": "independent"},
        },
        "floor": wall([0, -1, 0], [1, 0, 0], -90, {"type": "diffuse", "reflectance": tiles}),
        "ceiling": wall([0, 1, 0], [1, 0, 0], 90, diffuse(0.7, 0.7, 0.7)),
        "back": wall([0, 0, -1.2], [0, 1, 0], 0, diffuse(0.7, 0.7, 0.7)),
        "left": wall([-1.7, 0, 0], [0, 1, 0], 90, diffuse(0.6, 0.1, 0.1)),
        "right": wall([1.7, 0, 0], [0, 1, 0], -90, diffuse(0.1, 0.5, 0.15)),
        "ball": {"type": "sphere", "center": ball, "radius": 0.4, "bsdf": diffuse(0.3, 0.4, 0.7)},
        "cube": {
            "type": "cube",
            "to_world": mi.ScalarTransform4f()
            .translate([0.7, -0.65, -0.3])
            .rotate([0, 1, 0], 25)
            .scale([0.35, 0.35, 0.35]),
            "bsdf": diffuse(0.75, 0.7, 0.3),
        },
        "lamp": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f()
            .translate(lamp)
            .rotate([1, 0, 0], 90)
            .scale([0.35, 0.25, 1]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [60, 54, 44]}},
        },
    }
    if shot == UNEVEN:
        place = mi.ScalarTransform4f().translate([-2.2 + 1.3 * moved[UNEVEN], 0.8, 0.2])
        bsdf = {"type": "twosided", "bsdf": diffuse(0.7, 0.7, 0.7)}
        board = place.rotate([1, 0, 0], 90).scale([0.8, 0.5, 1])
        found["board"] = {"type": "rectangle", "to_world": board, "bsdf": bsdf}
    return found


if __name__ == "__main__":
    main()
