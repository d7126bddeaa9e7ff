"""Recordings of slices, of which several benchmarks put jobs together.

A recording is a file of (slices, height, width, 3) float32, each slice a mean. A recording that
ends early is continued. As a program, in a process for Mitsuba, this module records slices
(``slices FAMILY INTENSITY WIDTH HEIGHT SLICES SPP SEED FILE``) or what guides a denoiser, albedo
and normals (``guides FAMILY WIDTH HEIGHT FILE``). A family is a name, or the path of a scene's XML.
"""

import argparse
import subprocess
import sys
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench import ROOT
from plateau import scenes
from plateau.farm.model.spec import PLACES, ViewSpec
from plateau.metric import View

#: The paper's, under which the model of 2004 and the rules for it are measured.
PAPER: Final = View(**ViewSpec(**PLACES["paper"]).of_display())
HARD_SCENES: Final = Path(__file__).parent / "scenes"
_GUIDE_SPP: Final = 64


@dataclass(frozen=True)
class Case:
    """One scene under one light."""

    name: str  #: as in the paper: ``BAR 1``
    family: str  #: a folder of `scenes`, or a hard scene
    intensity: float  #: the scene's parameter of that name
    #: Seeds of the series and of the reference; no two renders of a family share samples.
    seeds: tuple[int, int]

    @property
    def slug(self) -> str:
        """The name in file names."""
        return self.name.lower().replace(" ", "-")


def cases(families: tuple[str, ...]) -> list[Case]:
    """Return the scenes of these families, each under a bright and under a dim light."""
    return [
        Case(f"{name.upper()} {number}", name, intensity, (2 * number - 2, 2 * number - 1))
        for name in families
        for number, intensity in enumerate(scenes.LIGHTS[name], 1)
    ]


#: The scenes by their names, and small scenes that are hard to render.
SCENES: Final = {case.name: case for case in cases(tuple(scenes.NAMES))}
HARD: Final = {
    name.upper(): Case(name.upper(), name, 1.0, (0, 1)) for name in ("fireflies", "caustic")
}


class Size(NamedTuple):
    """An image's, in pixels."""

    width: int
    height: int

    @classmethod
    def of(cls, text: str) -> "Size":
        """Read ``256``, across and down, or ``1920x1080``."""
        width, _, height = text.partition("x")
        return cls(int(width), int(height or width))

    def __str__(self) -> str:
        return f"{self.width}" + f"x{self.height}" * (self.width != self.height)


def parser_of(doc: str | None, choices: Collection[str] = SCENES) -> argparse.ArgumentParser:
    """Return a parser with the options that say what is recorded, and where."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=choices, default=list(choices))
    parser.add_argument(
        "--pixels", type=Size.of, default=Size(256, 256), help="256, or as 1920x1080 (256)"
    )
    parser.add_argument("--spp", type=int, default=10_000, help="of each recording (10,000)")
    parser.add_argument("--slice-spp", type=int, default=25, help="of a slice (25)")
    parser.add_argument("--runs", type=int, default=3, help="jobs of each scene (3)")
    parser.add_argument("--data", type=Path, default=ROOT / "allocation-data")
    return parser


def recorded(case: Case, asked: argparse.Namespace) -> NDArray[np.float32]:
    """Return a scene's recording, (slices, H, W, 3); record what is missing of it."""
    size: Size = asked.pixels
    file: Path = asked.data / f"{case.slug}-{size}-{asked.slice_spp}.f32"
    slices = asked.spp // asked.slice_spp
    seed = case.seeds[0] * 1_000_000
    record("slices", case.family, f"{case.intensity:g}", *size, slices, asked.slice_spp, seed, file)
    return np.memmap(file, np.float32, "r").reshape(-1, size.height, size.width, 3)


def guides_of(case: Case, asked: argparse.Namespace) -> NDArray[np.float32]:
    """Return albedo and normals of a scene, (2, H, W, 3)."""
    file: Path = asked.data / f"{case.slug}-{asked.pixels}.guides.npy"
    if not file.exists():
        record("guides", case.family, *asked.pixels, file)
    found: NDArray[np.float32] = np.load(file)
    return found


def recordings_row(name: str, asked: argparse.Namespace, runs: object) -> list[str]:
    """Return how a scene was recorded, as a row of a table with the head `RECORDED`."""
    return [f"{name}, {asked.pixels} px", *map(str, (asked.spp, asked.slice_spp, runs))]


RECORDED: Final = ["scene", "spp", "slice_spp", "runs"]


def record(*arguments: object) -> None:
    """Run this module as a program, which ends the arguments with the file that it writes."""
    Path(str(arguments[-1])).parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "bench.support.recordings", *map(str, arguments)]
    subprocess.run(command, check=True, cwd=ROOT)


def _load(mi: Any, family: str, **parameters: str) -> Any:
    """Return a scene, with those of the parameters that it has."""
    hard = HARD_SCENES / f"{family}.xml"
    named = hard if hard.exists() else scenes.FOLDER / family / "scene.xml"
    file = Path(family) if family.endswith(".xml") else named
    text = file.read_text()
    has = {name: value for name, value in parameters.items() if f"${name}" in text}
    # Otherwise several lamps may come in another order, and the same seed makes another image
    return mi.load_file(str(file), parallel=False, optimize=False, **has)


def main() -> None:
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    what, family, *rest, path = sys.argv[1:]
    if what == "guides":
        scene = _load(mi, family, width=rest[0], height=rest[1])
        guides = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
        image = np.array(mi.render(scene, spp=_GUIDE_SPP, integrator=guides), np.float32)
        np.save(path, np.stack([image[..., -6:-3], image[..., -3:]]))
        return
    intensity, width, height = rest[:3]
    slices, spp, seed = map(int, rest[3:])
    scene = _load(mi, family, width=width, height=height, intensity=intensity)
    size = int(width) * int(height) * 3 * 4
    done = Path(path).stat().st_size // size if Path(path).exists() else 0
    with Path(path).open("ab") as file:
        file.truncate(done * size)
        for number in range(done, slices):
            image = mi.render(scene, spp=spp, seed=seed + number)
            file.write(np.array(image, np.float32)[..., :3].tobytes())


if __name__ == "__main__":
    main()
