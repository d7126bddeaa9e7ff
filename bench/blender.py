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
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.support import markdown
from bench.support.cores import others_meanwhile
from bench.support.report import (
    OTHERS,
    Figure,
    figure,
    last_figures,
    last_report,
    others_figure,
    renewed,
    write_report,
)

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
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--parts", nargs="+", choices=_PARTS, default=list(_PARTS))
    parser.add_argument("--size", type=int, default=192, help="pixels of a side (192)")
    parser.add_argument("--reference-spp", type=int, default=4096, help="(4,096)")
    parser.add_argument("--max-spp", type=int, default=4000, help="the farm's cap (4,000)")
    parser.add_argument("--equal-spp", type=int, default=400, help="of slices, and at once (400)")
    parser.add_argument("--turns", type=int, default=3, help="of slices, and at once (3)")
    options = parser.parse_args()
    if find_spec("bpy") is None:
        print("Blender is not here: .venv-blender/bin/python -m bench.blender", file=sys.stderr)
        return
    kept, settings = last_figures("blender"), last_report("blender")["settings"].get("cases", {})
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes:
            blend = Path(folder) / f"{scene}.blend"
            _in_blender("make", scene, str(blend), str(options.size))
            for part in options.parts:
                measure, used = _PARTS[part]
                with others_meanwhile() as others:
                    found = measure(blend, options)
                found.append(others_figure([others.share]))
                print(scene, *found, sep="\n", file=sys.stderr, flush=True)
                case = _case(scene, options.size, part)
                kept = renewed(kept, case, found)
                settings[case] = {name: getattr(options, name) for name in used}
    report = write_report(
        "blender",
        kept,
        settings={"cases": settings},
        notes=(
            "Images are single runs. The reference has noise of its own, which counts as wrong.",
            "Processor time is that of all processes; of slices, the least of some turns.",
        ),
    )
    markdown.fill(markdown.DOCS / "blender.md", tables(report))


def _images(blend: Path, options: argparse.Namespace) -> list[Figure]:
    """Render a scene in all ways, and compare with a reference."""
    folder, reference = blend.parent, blend.with_suffix(".exr")
    _in_blender("reference", str(blend), str(reference), str(options.reference_spp))
    images = {}
    for way, more in WAYS.items():
        out, before = folder / f"{blend.stem} {way}", _processor_s()
        _plateau("render", str(blend), "-o", str(out), "--max-spp", str(options.max_spp), *more)
        spent = _processor_s() - before
        spp = json.loads((out / "summary.json").read_text())["spp"]
        images[way] = Image(spp, spent, _wrong(reference, out / "image.exr"))
    image = folder / f"{blend.stem} alone.exr"
    cycles = json.loads(_in_blender("alone", str(blend), str(image)).splitlines()[-1])
    images[ALONE] = Image(cycles["spp"], cycles["processor_s"], _wrong(reference, image))
    return [
        figure(f"{way}: {field}", [value], unit)
        for way, image in images.items()
        for (field, value), unit in zip(image._asdict().items(), _UNITS, strict=True)
    ]


def _slices(blend: Path, options: argparse.Namespace) -> list[Figure]:
    """Render the same samples as slices of some sizes, and at once."""
    order = [str(blend), str(options.equal_spp), str(options.turns), *map(str, SLICES)]
    took_s = json.loads(_in_blender("slices", *order).splitlines()[-1])
    least, most = SLICES[0], SLICES[-1]
    more = options.equal_spp / least - options.equal_spp / most
    pixel_us = 1e6 / options.size**2
    slice_us = (took_s[str(least)] - took_s[str(most)]) * pixel_us / more
    sample_us = took_s[str(most)] * pixel_us / options.equal_spp - slice_us / most
    return [
        *(
            figure(
                _OF_SLICES.format(size),
                [took_s["at once"] / took_s[str(size)]],
                "ratio",
                compared_with="the processor time of Cycles for the same samples at once",
                goal="at least 0.95",
            )
            for size in SLICES
        ),
        figure(_OF_A_SAMPLE, [sample_us], "µs"),
        figure(_BESIDE, [slice_us], "µs"),
    ]


#: What is measured of a scene, by what, and the options that count for it.
_PARTS: Final[dict[str, tuple[Callable[[Path, argparse.Namespace], list[Figure]], list[str]]]] = {
    "images": (_images, ["reference_spp", "max_spp"]),
    "slices": (_slices, ["equal_spp", "turns"]),
}
_OF_SLICES: Final = "efficiency of slices of {} spp"
_OF_A_SAMPLE: Final = "processor time of a sample"
_BESIDE: Final = "processor time of a pixel of a slice, beside its samples"
_UNITS: Final = ("spp", "s", "of the pixels")
_CASE: Final = ("scene", "size")
_COSTS: Final = ("a sample", "a slice's pixel beside them")
_BUSY: Final = "other work on the cores"


def _case(scene: str, size: int, part: str) -> str:
    return f"{scene}, {size} px, {part}"


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
    for case, settings in report["settings"]["cases"].items():
        scene, size, part = case.split(", ")
        row, busy = [SCENES[scene], size], f"{found[f'{case}: {OTHERS}']:.0%}"
        if part == "slices":
            ratios = (found[f"{case}: {_OF_SLICES.format(size)}"] for size in SLICES)
            costs = (found[f"{case}: {one}"] for one in (_OF_A_SAMPLE, _BESIDE))
            row += [f"{settings['equal_spp']} spp", *(f"{ratio:.2f}" for ratio in ratios)]
            slices.append([*row, *(f"{cost:.1f} µs" for cost in costs), busy])
            continue
        for way in (*WAYS, ALONE):
            spp, processor_s, wrong = (found[f"{case}: {way}: {one}"] for one in Image._fields)
            row.append(f"{spp:.0f} spp, {processor_s:.0f} s, {wrong:.2%}")
        images.append([*row, busy])
    return {
        "blender-images": markdown.table([*_CASE, *WAYS, ALONE, _BUSY], images),
        "blender-slices": markdown.table(
            [*_CASE, "at once", *(f"of {size} spp" for size in SLICES), *_COSTS, _BUSY], slices
        ),
    }


if __name__ == "__main__":
    main()
