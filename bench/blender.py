"""The farm against Cycles alone, on three scenes: `.venv-blender/bin/python -m bench.blender`.

Each scene is rendered to a reference, by the farm until its rule stops (plain, and denoised), and
by Cycles alone with its adaptive sampling and its denoiser at their defaults. What counts is
samples, processor time, and pixels that differ visibly from the reference. Then the same samples
are rendered as slices of some sizes and at once: the ratio of their processor time is what slicing
costs. Needs `make test-blender` once.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.support import markdown
from bench.support.cores import others_meanwhile
from bench.support.report import Figure, figure, others_figure, write_report

SCENES: Final = {
    "glass": "a closed room with a glass ball",
    "still": "a still life on fine checks",
    "smoke": "a cube of smoke",
}
WAYS: Final = {"farm": (), "farm, denoised": ("--denoise", "oidn")}
ALONE: Final = "Cycles alone, denoised"
SLICES: Final = (25, 50, 100)


class Image(NamedTuple):
    """What an image has cost, and how it is."""

    spp: float
    processor_s: float  #: of all processes
    wrong: float  #: of the pixels, visibly


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=192, help="pixels of a side")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--max-spp", type=int, default=4000)
    parser.add_argument("--equal-spp", type=int, default=400, help="spp of the comparison of costs")
    options = parser.parse_args()
    if find_spec("bpy") is None:
        print("Blender is not here: .venv-blender/bin/python -m bench.blender", file=sys.stderr)
        return
    figures: list[Figure] = []
    shares = []
    with tempfile.TemporaryDirectory() as folder:
        for scene in SCENES:
            with others_meanwhile() as others:
                found = _measured(scene, Path(folder), options)
            print(*found, sep="\n", file=sys.stderr, flush=True)
            figures += found
            shares.append(others.share)
    report = write_report(
        "blender",
        [*figures, others_figure(shares)],
        settings=vars(options),
        notes=(
            "Single runs. The reference has noise of its own, which counts as wrong.",
            "Processor time is that of all processes; of slices, the least of some turns.",
        ),
    )
    markdown.fill(markdown.DOCS / "blender.md", tables(report))


def _measured(scene: str, folder: Path, options: argparse.Namespace) -> list[Figure]:
    """Render a scene in all ways, and compare."""
    blend, reference = folder / f"{scene}.blend", folder / f"{scene}.exr"
    _in_blender("make", scene, str(blend), str(options.size))
    _in_blender("reference", str(blend), str(reference), str(options.reference_spp))
    images = {}
    for way, more in WAYS.items():
        out, before = folder / f"{scene} {way}", _processor_s()
        _plateau("render", str(blend), "-o", str(out), "--max-spp", str(options.max_spp), *more)
        spent = _processor_s() - before
        spp = json.loads((out / "summary.json").read_text())["spp"]
        images[way] = Image(spp, spent, _wrong(reference, out / "image.exr"))
    image = folder / f"{scene} alone.exr"
    cycles = json.loads(_in_blender("alone", str(blend), str(image)).splitlines()[-1])
    images[ALONE] = Image(cycles["spp"], cycles["processor_s"], _wrong(reference, image))
    said = _in_blender("slices", str(blend), str(options.equal_spp), *map(str, SLICES))
    took_s = json.loads(said.splitlines()[-1])
    return [
        *(
            figure(_of_image(scene, way, field), [value], unit)
            for way, image in images.items()
            for (field, value), unit in zip(image._asdict().items(), _UNITS, strict=True)
        ),
        *(
            figure(
                _of_slices(scene, size),
                [took_s["at once"] / took_s[str(size)]],
                "ratio",
                compared_with="the processor time of Cycles for the same samples at once",
                goal="at least 0.95",
            )
            for size in SLICES
        ),
    ]


_UNITS: Final = ("spp", "s", "of the pixels")


def _of_image(scene: str, way: str, field: str) -> str:
    return f"{scene}: {way}: {field}"


def _of_slices(scene: str, spp: int) -> str:
    return f"{scene}: efficiency of slices of {spp} spp"


def _processor_s() -> float:
    """Return what processes that have ended have used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _wrong(reference: Path, image: Path) -> float:
    """Return the share of the pixels that differ visibly."""
    return float(
        json.loads(_plateau("diff", str(reference), str(image), "--json"))["visible_fraction"]
    )


def _plateau(*arguments: str) -> str:
    return _run("plateau", *arguments)


def _in_blender(*arguments: str) -> str:
    return _run("bench.support.in_blender", *arguments)


def _run(module: str, *arguments: str) -> str:
    command = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown, by the names of the places in the document."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    images, slices = [], []
    for scene, words in SCENES.items():
        cells = []
        for way in (*WAYS, ALONE):
            spp, processor_s, wrong = (found[_of_image(scene, way, one)] for one in Image._fields)
            cells.append(f"{spp:.0f} spp, {processor_s:.0f} s, {wrong:.2%}")
        images.append([words, *cells])
        slices.append([words, *(f"{found[_of_slices(scene, size)]:.2f}" for size in SLICES)])
    sized = {name.replace("_", " "): value for name, value in report["settings"].items()}
    return {
        "blender-machine": markdown.machine({**report, "settings": sized}, tuple(sized)),
        "blender-images": markdown.table(["", *WAYS, ALONE], images),
        "blender-slices": markdown.table(["", *(f"of {size} spp" for size in SLICES)], slices),
    }


if __name__ == "__main__":
    main()
