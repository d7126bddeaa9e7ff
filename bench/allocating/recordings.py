"""Recordings of slices, of which several benchmarks put jobs together, and what all of them ask."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bench import ROOT
from bench.experiment.cases import Case, cases
from plateau import scenes

if TYPE_CHECKING:
    import argparse
    from collections.abc import Collection

    from numpy.typing import NDArray

#: The scenes by their names.
SCENES = {case.name: case for case in cases(tuple(scenes.NAMES))}
#: Small scenes that are hard to render.
HARD = {name.upper(): Case(name.upper(), name, 1.0, (0, 1)) for name in ("fireflies", "caustic")}
HARD_SCENES = Path(__file__).parent / "scenes"


class Size(NamedTuple):
    """An image's, in pixels."""

    width: int
    height: int

    @classmethod
    def of(cls, text: str) -> Size:
        """Read ``256``, across and down, or ``1920x1080``."""
        width, _, height = text.partition("x")
        return cls(int(width), int(height or width))

    def __str__(self) -> str:
        return f"{self.width}" + f"x{self.height}" * (self.width != self.height)


def add_options(parser: argparse.ArgumentParser, *, choices: Collection[str] = SCENES) -> None:
    """Add the options that say what is recorded, and where."""
    parser.add_argument("--cases", nargs="+", choices=choices, default=list(choices))
    parser.add_argument(
        "--pixels", type=Size.of, default=Size(256, 256), help="256, or as 1920x1080 (256)"
    )
    parser.add_argument("--spp", type=int, default=10_000, help="of each recording (10,000)")
    parser.add_argument("--slice-spp", type=int, default=25, help="of a slice (25)")
    parser.add_argument("--runs", type=int, default=3, help="jobs of each scene (3)")
    parser.add_argument("--data", type=Path, default=ROOT / "allocation-data")


def load(mi: Any, family: str, **parameters: str) -> Any:
    """Return a scene, with those of the parameters that it has."""
    hard = HARD_SCENES / f"{family}.xml"
    file = hard if hard.exists() else scenes.FOLDER / family / "scene.xml"
    text = file.read_text()
    has = {name: value for name, value in parameters.items() if f"${name}" in text}
    return mi.load_file(str(file), **has)


def recorded(case: Case, size: Size, spp: int, slice_spp: int, data: Path) -> NDArray[np.float32]:
    """Return a scene's recording, (slices, H, W, 3); record what is missing of `spp`."""
    data.mkdir(parents=True, exist_ok=True)
    file = data / f"{case.slug}-{size}-{slice_spp}.f32"
    command = [case.family, f"{case.intensity:g}", *size, spp // slice_spp, slice_spp]
    seed = case.seeds[0] * 1_000_000
    subprocess.run(
        [sys.executable, "-m", "bench.allocating.record", *map(str, (*command, seed, file))],
        check=True,
        cwd=ROOT,
    )
    return np.memmap(file, np.float32, "r").reshape(-1, size.height, size.width, 3)
