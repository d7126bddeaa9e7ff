"""Records slices of a scene, in a process of its own for Mitsuba.

A recording is a file of (slices, height, width, 3) float32, each slice a mean. A recording that
ends early is continued.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.allocating.recordings import load


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("family", "intensity", "width", "height"):
        parser.add_argument(name)
    for name in ("slices", "spp", "seed"):
        parser.add_argument(name, type=int)
    parser.add_argument("file", type=Path)
    asked = parser.parse_args()

    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    scene = load(
        mi,
        asked.family,
        width=asked.width,
        height=asked.height,
        intensity=asked.intensity,
    )
    size = int(asked.width) * int(asked.height) * 3 * 4
    done = asked.file.stat().st_size // size if asked.file.exists() else 0
    with asked.file.open("ab") as file:
        file.truncate(done * size)
        for number in range(done, asked.slices):
            image = mi.render(scene, spp=asked.spp, seed=asked.seed + number)
            file.write(np.array(image, np.float32)[..., :3].tobytes())


if __name__ == "__main__":
    main()
