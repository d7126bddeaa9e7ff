"""CPU time of one evaluation of the metric, as a job makes it: `make bench-vdp`.

In a job the reference is prepared once; an evaluation prepares the new image, compares, maps and
counts. All ways take turns in one run, so that a busy machine slows them alike:

- plain: numpy, every formula for every pixel (`bench.support.bare.vdp_ways`), reference prepared
  once
- numpy: `metric.VisibleDifferences`, which computes masking only for pixels that need it; likewise
- compiled: `plateau.metric.compiled`, likewise, on one thread
- FLIP (`pip install flip-evaluator`), on both images, CPU time of all its threads
- PerceptualDiff, where it is on the PATH, on both images, reading them included
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.support import markdown
from bench.support.bare.vdp_ways import Flip, PerceptualDiff, PlainPredictor, cpu_s, noisy_pair
from bench.support.report import Figure, figure, write_report
from plateau.metric import View, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences

if TYPE_CHECKING:
    from collections.abc import Callable

SIZES = {"512²": (512, 512), "1080p": (1080, 1920), "2160p": (2160, 3840)}
#: Standard deviation of the noise over the signal's: as after a few samples per pixel, and as near
#: a stop, where most pixels need their threshold elevation.
NOISES = {"strong noise": 0.2, "weak noise": 0.02}

_GOALS = {
    "512²": "at least 7, better 14",
    "1080p": "at least 11, better 22",
    "2160p": "at least 16, better 32",
}
_PLAIN, _NUMPY, _COMPILED = "plain numpy", "numpy", "compiled"
#: At most this share of pixels may differ between the ways.
_TOLERANCE = 1e-4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--turns", type=int, default=7, help="evaluations of each way")
    options = parser.parse_args()

    notes = [
        "CPU time, not wall time. Ratios are of the same turn: plain numpy's over the other's.",
        "FLIP and PerceptualDiff prepare both images every time; the other ways only the new one.",
        "Preparing the reference too takes the compiled way 1.3 to 1.6 times as long.",
        "The images are synthetic: gradients and edges with Gaussian noise.",
    ]
    notes += [
        f"{name} is not here and was left out."
        for name, way in (("FLIP", Flip), ("PerceptualDiff", PerceptualDiff))
        if not way.is_here()
    ]
    figures = [
        one
        for size in options.sizes
        for noise in NOISES
        for one in _take_turns(size, noise, options.turns)
    ]
    report = write_report(
        "vdp",
        [*figures, *_in_a_fresh_process(options.sizes[-1])],
        settings={"sizes": options.sizes, "turns": options.turns, "noises": NOISES},
        notes=notes,
    )
    markdown.fill(markdown.DOCS / "metric.md", {"vdp": table(report)})


def table(report: dict[str, Any]) -> str:
    """Return a report as Markdown: CPU time of each way, and how many times that of the first."""
    found = {(one["name"], one["compared_with"]): one["value"] for one in report["figures"]}
    ways = ("plain numpy", "numpy", "FLIP")
    cases = [name.split(": ")[0] for name, _ in found if name.endswith(": compiled")]
    return markdown.table(
        ["image", "compiled", *ways],
        [
            [
                case,
                f"{found[f'{case}: compiled', None] * 1000:.3g} ms",
                *(
                    f"{found[f'{case}: {way}', None]:.3g} s "
                    f"({found[f'{case}: compiled is faster by', way]:.3g})"
                    for way in ways
                    if (f"{case}: {way}", None) in found
                ),
            ]
            for case in cases
        ],
    )


def _take_turns(size: str, noise: str, turns: int) -> list[Figure]:
    """Return each way's CPU time, and how many times faster than the plain one it is."""
    reference, test = noisy_pair(SIZES[size], NOISES[noise])
    ways: dict[str, Callable[[], float | None]] = _ours(reference, test)
    with tempfile.TemporaryDirectory() as folder:
        flip = Flip(reference, test) if Flip.is_here() else None
        if flip is not None:
            ways["FLIP"] = flip.cpu_s
            flip.cpu_s()  # loads it
        if PerceptualDiff.is_here():
            ways["PerceptualDiff"] = PerceptualDiff(reference, test, Path(folder)).cpu_s
        times = [{name: way() for name, way in ways.items()} for _ in range(turns)]
        if flip is not None:
            flip.close()

    title = f"{size}, {noise}"
    figures = []
    for name in ways:
        measured = [turn[name] for turn in times]
        if any(value is None for value in measured):
            print(f"{title}: {name} ended its process, and is left out")
            continue
        figures.append(figure(f"{title}: {name}", [value or 0 for value in measured], "s"))
        if name != _COMPILED:
            figures.append(
                figure(
                    f"{title}: compiled is faster by",
                    [(turn[name] or 0) / (turn[_COMPILED] or 1) for turn in times],
                    "ratio",
                    compared_with=name,
                    goal=_GOALS[size] if name == _PLAIN else None,
                )
            )
    return figures


def _ours(reference: Any, test: Any) -> dict[str, Callable[[], float | None]]:
    """Return our three ways, warmed up and checked against each other."""
    plain, lazy = PlainPredictor(View()), VisibleDifferences(View())
    compiled = CompiledVisibleDifferences(View())
    prepared, kept = lazy.percept(reference), compiled.percept(reference)
    kept.keep()

    def evaluate_plainly() -> Any:
        visible = plain.visible(prepared, plain.percept(test))
        return visible, np.count_nonzero(visible)

    def evaluate() -> Any:
        return lazy.compare(prepared, lazy.percept(test)).visible

    def evaluate_compiled() -> Any:
        return compiled.compare(kept, compiled.percept(test)).visible

    expected = evaluate_plainly()[0]
    for visible in (evaluate(), evaluate_compiled()):
        share = np.count_nonzero(visible != expected) / expected.size
        if share > _TOLERANCE:
            raise AssertionError(f"two ways see another difference in {share:.2%} of the pixels")
    return {
        _PLAIN: lambda: cpu_s(evaluate_plainly),
        _NUMPY: lambda: cpu_s(evaluate),
        _COMPILED: lambda: cpu_s(evaluate_compiled),
    }


def _in_a_fresh_process(size: str) -> list[Figure]:
    """Return the costs of starting, without and with cached kernels, and the memory."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("reference.npy", "test.npy")]
        for file, image in zip(files, noisy_pair(SIZES[size], NOISES["weak noise"]), strict=True):
            np.save(file, image)
        command = [sys.executable, "-m", "bench.support.bare.vdp_child", *map(str, files)]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder, "kernels"))}
        cold, warm = (
            json.loads(subprocess.check_output(command, env=environment)) for _ in range(2)
        )
        cached = sum(file.stat().st_size for file in Path(folder, "kernels").rglob("*.nb?"))
    figures = [
        figure("importing metric.compiled", [warm["import_s"]], "s"),
        figure("compiling the kernels", [cold["first_s"] - 2 * cold["again_s"]], "s"),
        figure("loading them from the cache", [warm["first_s"] - 2 * warm["again_s"]], "s"),
        figure("the cache", [cached / 2**20], "MiB"),
    ]
    if warm["peak_mib"] is not None:
        name = f"{size}: peak memory, both images and the interpreter included"
        figures.append(figure(name, [warm["peak_mib"]], "MiB", goal="under 1000"))
    return figures


if __name__ == "__main__":
    main()
