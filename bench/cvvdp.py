"""Time of one comparison by ColorVideoVDP at 1080p, ours and the authors': `make bench-cvvdp`.

Both prepare both images every time, on one core and on two, and take turns in one run, each in a
process of its own. The authors' package (`pip install cvvdp`) may be another environment's:
`python -m bench.cvvdp --python ITS_INTERPRETER`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bench import ROOT
from bench.support import markdown
from bench.support.bare import cvvdp_child
from bench.support.bare.vdp_ways import noisy_pair
from bench.support.report import Figure, figure, write_report

#: Standard deviation of the noise over the signal's.
_NOISE = 0.1
_WAYS = {"ours": "ours", "authors": "the authors'"}
#: The greatest difference in JOD.
_TOLERANCE = 0.02


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable, help="interpreter that has cvvdp")
    parser.add_argument("--turns", type=int, default=7, help="comparisons of each way")
    options = parser.parse_args()

    if options.python == sys.executable and find_spec("pycvvdp") is None:
        print("The authors' package is not here: pip install cvvdp")
        return
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("reference.npy", "test.npy")]
        for file, image in zip(files, noisy_pair((1080, 1920), _NOISE), strict=True):
            np.save(file, np.clip(image, 0, 1))
        for cores in (1, 2):
            figures += _take_turns(files, options.python, cores, options.turns)
    report = write_report(
        "cvvdp",
        figures,
        settings={"turns": options.turns, "noise": _NOISE},
        notes=["Wall time of one comparison, both images prepared each time."],
    )
    markdown.fill(markdown.DOCS / "metric.md", {"cvvdp": table(report)})


def table(report: dict[str, Any]) -> str:
    """Return a report as Markdown: time and memory of both ways on one core and on two."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    return markdown.table(
        ["1920×1080", "ours", "the authors'", "ratio", "memory, ours", "memory, the authors'"],
        [
            [
                cores,
                *(f"{found[f'{cores}: {way}']:.3g} s" for way in _WAYS.values()),
                f"{found[f'{cores}: ours is faster by']:.3g}",
                *(f"{found[f'{cores}: memory, {way}']:.0f} MiB" for way in _WAYS.values()),
            ]
            for cores in ("1 core", "2 cores")
        ],
    )


def _take_turns(files: list[Path], python: str, cores: int, turns: int) -> list[Figure]:
    """Return both ways' times and memory on this many cores, and the ratio of their turns."""
    some = set(sorted(os.sched_getaffinity(0))[:cores])
    children = {
        way: subprocess.Popen(
            [interpreter, cvvdp_child.__file__, way, *map(str, files)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=ROOT,
            preexec_fn=lambda: os.sched_setaffinity(0, some),
        )
        for way, interpreter in (("ours", sys.executable), ("authors", python))
    }
    jod = [_answer(child) for child in children.values()]
    if abs(jod[0] - jod[1]) > _TOLERANCE:
        raise AssertionError(f"the two ways differ: {jod[0]} and {jod[1]} JOD")
    times: dict[str, list[float]] = {way: [] for way in children}
    for _ in range(turns):
        for way, child in children.items():
            assert child.stdin is not None
            child.stdin.write("\n")
            child.stdin.flush()
            times[way].append(_answer(child))

    title = "1 core" if cores == 1 else f"{cores} cores"
    figures = []
    for way, child in children.items():
        assert child.stdin is not None
        child.stdin.close()
        figures.append(figure(f"{title}: {_WAYS[way]}", times[way], "s"))
        figures.append(figure(f"{title}: memory, {_WAYS[way]}", [_answer(child)], "MiB"))
        child.wait()
    ratios = [theirs / ours for ours, theirs in zip(*times.values(), strict=True)]
    name = f"{title}: ours is faster by"
    goal = "at least 5"
    figures.append(figure(name, ratios, "ratio", compared_with=_WAYS["authors"], goal=goal))
    return figures


def _answer(child: subprocess.Popen[str]) -> float:
    assert child.stdout is not None
    return float(child.stdout.readline())


if __name__ == "__main__":
    main()
