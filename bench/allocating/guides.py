"""Renders what guides a denoiser, albedo and normals of a scene, in a process for Mitsuba."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.allocating.recordings import load

SPP = 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("family", "width", "height"):
        parser.add_argument(name)
    parser.add_argument("file", type=Path)
    asked = parser.parse_args()

    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    scene = load(mi, asked.family, width=asked.width, height=asked.height)
    guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
    image = np.array(mi.render(scene, spp=SPP, integrator=guides), np.float32)
    np.save(asked.file, np.stack([image[..., -6:-3], image[..., -3:]]))


if __name__ == "__main__":
    main()
