"""The farm against Cycles alone, on three scenes: `.venv-blender/bin/python -m bench.blender`.

Each scene is rendered to a reference, by the farm until its rule stops (plain, and denoised), and
by Cycles alone with its adaptive sampling and its denoiser at their defaults. What counts is
samples, and pixels that differ visibly from the reference. Then the same samples are rendered as
slices and at once: the ratio of their processor time is what slicing costs. Needs
`make test-blender` once.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from bench.support.report import figure, write_report

SCENES: Final = ("glass", "still", "smoke")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--size", type=int, default=192, help="pixels of a side")
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--max-spp", type=int, default=4000)
    parser.add_argument("--equal-spp", type=int, default=400, help="spp of the comparison of costs")
    options = parser.parse_args()
    if find_spec("bpy") is None:
        print("Blender is not here: .venv-blender/bin/python -m bench.blender", file=sys.stderr)
        return
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            found = measure(scene, Path(folder), options)
            print(f"{scene}: {found}", file=sys.stderr, flush=True)
            for name, (spp, wrong) in found["images"].items():
                figures += [
                    figure(f"{scene}, {name}: samples", [spp], "spp"),
                    figure(f"{scene}, {name}: visibly wrong", [wrong], "of the pixels"),
                ]
            figures.append(
                figure(
                    f"{scene}: efficiency of slices",
                    [found["efficiency"]],
                    "ratio",
                    compared_with="the processor time of Cycles for the same samples at once",
                    goal="at least 0.95",
                )
            )
    write_report(
        "blender",
        figures,
        settings=vars(options),
        notes=(
            "Single runs. The reference has noise of its own, which counts as wrong.",
            "Efficiency is by processor time, the least of two runs, on a machine that was shared.",
        ),
    )


def measure(scene: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Render a scene in all ways, and compare."""
    blend, reference = folder / f"{scene}.blend", folder / f"{scene}.exr"
    _in_blender("make", scene, str(blend), str(options.size))
    _in_blender("reference", str(blend), str(reference), str(options.reference_spp))
    images = {}
    for name, more in (("farm", ()), ("farm denoised", ("--denoise", "oidn"))):
        out = folder / f"{scene} {name}"
        _plateau("render", str(blend), "-o", str(out), "--max-spp", str(options.max_spp), *more)
        summary = json.loads((out / "summary.json").read_text())
        images[name] = summary["spp"], _wrong(reference, out / "image.exr")
    image = folder / f"{scene} alone.exr"
    cycles = json.loads(_in_blender("alone", str(blend), str(image)).splitlines()[-1])
    images["Cycles alone"] = cycles["spp"], _wrong(reference, image)
    said = _in_blender("slices", str(blend), str(options.equal_spp))
    costs = json.loads(said.splitlines()[-1])
    return {"images": images, "efficiency": costs["at_once_s"] / costs["sliced_s"]}


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


if __name__ == "__main__":
    main()
