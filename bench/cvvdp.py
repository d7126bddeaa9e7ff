"""Time of a comparison by ColorVideoVDP at 1080p, ours and the authors': `make bench-cvvdp`.

Both prepare both images, or all frames of both videos, every time, on one core and on two, and take
turns in one run, each in a process of its own. Cases that are not measured now keep their figures:
`python -m bench.cvvdp video` measures videos alone. The authors' package (`pip install cvvdp`) may
be another environment's: `python -m bench.cvvdp --python ITS_INTERPRETER`.
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
from bench.support.report import Figure, figure, last_figures, last_report, write_report

_NOTES = [
    "Wall time of one comparison, both images prepared each time; of a video, for each frame.",
    f"Videos have {cvvdp_child.FRAMES} frames at {cvvdp_child.FPS} per second, and are not stored.",
]
#: Standard deviation of the noise over the signal's.
_NOISE = 0.1
#: What is compared, and what the names of its figures begin with.
_CASES = {"still": "", "video": "video, "}
_WAYS = {"ours": "ours", "authors": "the authors'"}
#: The greatest difference in JOD.
_TOLERANCE = 0.02


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", choices=_CASES, default=list(_CASES))
    parser.add_argument("--python", default=sys.executable, help="interpreter that has cvvdp")
    parser.add_argument("--turns", type=int, default=7, help="comparisons of each way")
    options = parser.parse_args()

    if options.python == sys.executable and find_spec("pycvvdp") is None:
        print("The authors' package is not here: pip install cvvdp")
        return
    figures, settings = last_figures("cvvdp"), last_report("cvvdp")["settings"]
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("reference.npy", "test.npy")]
        for file, image in zip(files, noisy_pair((1080, 1920), _NOISE), strict=True):
            np.save(file, np.clip(image, 0, 1))
        for case in options.cases:
            titles = {cores: _title(case, cores) for cores in (1, 2)}
            starts = tuple(f"{title}: " for title in titles.values())
            figures = [one for one in figures if not one.name.startswith(starts)]
            settings[case] = {"turns": options.turns, "noise": _NOISE}
            for cores in titles:
                figures += _take_turns(case, files, options.python, cores, options.turns)
    report = write_report("cvvdp", figures, settings=settings, notes=_NOTES)
    markdown.fill(markdown.DOCS / "metric.md", {"cvvdp": table(report)})


def table(report: dict[str, Any]) -> str:
    """Return a report as Markdown: time and memory of both ways on one core and on two."""
    found = {one["name"]: one["value"] for one in report["figures"]}
    return markdown.table(
        [
            "1920×1080, each frame",
            "ours",
            "the authors'",
            "ratio",
            "memory, ours",
            "memory, the authors'",
        ],
        [
            [
                title,
                *(f"{found[f'{title}: {way}']:.3g} s" for way in _WAYS.values()),
                f"{found[f'{title}: ours is faster by']:.3g}",
                *(f"{found[f'{title}: memory, {way}']:.0f} MiB" for way in _WAYS.values()),
            ]
            for case in _CASES
            for title in (_title(case, 1), _title(case, 2))
        ],
    )


def _title(case: str, cores: int) -> str:
    return f"{_CASES[case]}{cores} core{'s' * (cores > 1)}"


def _take_turns(case: str, files: list[Path], python: str, cores: int, turns: int) -> list[Figure]:
    """Return both ways' times and memory on this many cores, and the ratio of their turns."""
    some = set(sorted(os.sched_getaffinity(0))[:cores])
    children = {
        way: subprocess.Popen(
            [interpreter, cvvdp_child.__file__, way, case, *map(str, files)],
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

    title, frames = _title(case, cores), cvvdp_child.FRAMES if case == "video" else 1
    figures = []
    for way, child in children.items():
        assert child.stdin is not None
        child.stdin.close()
        figures.append(figure(f"{title}: {_WAYS[way]}", [t / frames for t in times[way]], "s"))
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
