"""The paper's experiment on our own scenes and our own farm: `make bench-paper`.

For each scene the farm renders a series of slices and an independent reference; every rule then
judges the same slices. Renders are kept in a folder, so that a run that was stopped goes on, and
images are judged anew without being rendered. What was found of each scene is kept in the results,
so that scenes can be run one after the other, on different days.

At 256×256 and 10,000 spp all eight take 10.5 thousand million samples and 2 GB of disk. The paper's
own size is --size 512.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import scenes
from bench.experiment import plots, tables
from bench.experiment.cases import Case, cases
from bench.experiment.contenders import TARGET
from bench.experiment.renders import SLICE_SPP, Size, rendered
from bench.experiment.series import STEPS, Measured, measure
from bench.support import markdown, report
from bench.support.report import Figure, write_report

_ROOT = Path(__file__).parents[1]
_NOTES = (
    f"True: at most {TARGET:.1%} of the pixels differ visibly from the independent reference.",
    "The reference has noise of its own, so true is later than against a converged image.",
    "Every rule judges the same slices, at the default view and with its default parameters.",
    "No rule ends a series: each goes on to the cap.",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=256, help="pixels across and down (256)")
    parser.add_argument("--cap", type=int, default=10_000, help="spp of each series (10,000)")
    parser.add_argument("--scenes", nargs="+", choices=scenes.NAMES, default=scenes.NAMES)
    parser.add_argument("--workers", type=int, default=1, help="worker processes (1)")
    parser.add_argument(
        "--data", type=Path, default=_ROOT / "paper-data", help="folder of renders (./paper-data)"
    )
    options = parser.parse_args()
    if options.cap % max(STEPS) or options.cap < max(STEPS):
        parser.error(f"--cap must be a multiple of {max(STEPS)}, not {options.cap}")
    size = Size(options.size, options.cap)
    run(cases(tuple(options.scenes)), size, options.data, workers=options.workers)
    for document in ("paper.md", "stopping.md"):
        markdown.fill(markdown.DOCS / document, tables_of(known()))


def run(todo: list[Case], size: Size, data: Path, *, workers: int) -> list[Measured]:
    """Render what is not rendered yet, judge it, and report on it and on all that was known."""
    data.mkdir(parents=True, exist_ok=True)
    folder = _folder()
    folder.mkdir(parents=True, exist_ok=True)
    for case in todo:
        renders = rendered(case, size, data, workers=workers)
        started = time.monotonic()
        one = measure(renders)
        one.write(folder / f"{case.slug}.json")
        print(f"{case.name}: judged in {time.monotonic() - started:.0f} s", file=sys.stderr)
    found = known()
    draw(found, folder)
    write_report(
        "paper",
        figures(found),
        settings={
            "slice_spp": SLICE_SPP,
            "steps": list(STEPS),
            "scenes": {
                one.name: {"size": f"{one.pixels}×{one.pixels}", "cap": one.cap} for one in found
            },
        },
        notes=_NOTES,
    )
    return found


def known() -> list[Measured]:
    """Return every series that the results hold, in the order of the paper's tables."""
    return [Measured.read(path) for path in sorted(_folder().glob("*.json"))]


def tables_of(found: list[Measured]) -> dict[str, str]:
    """Return every table by the name of its place in the documents."""
    return {
        "truth": tables.truth_table(found),
        **{f"stops-{step}": tables.stop_table(found, step) for step in STEPS},
        "summary": tables.summary_table(found),
        "real": tables.estimate_table(found),
        "real-forecast": tables.forecast_table(found),
        "opinions": tables.opinion_table(found),
    }


def draw(found: list[Measured], folder: Path) -> None:
    """Write the pictures into a folder."""
    plots.plot_counts(found, [f"successive @{step}" for step in STEPS], folder / "figure-4.png")
    plots.plot_counts(
        found, [f"multiple, window {window} @100" for window in (5, 8)], folder / "figure-5.png"
    )
    plots.plot_reverse(found, folder / "figure-6.png")
    plots.plot_truth(found, folder / "truth.png")


def figures(found: list[Measured]) -> list[Figure]:
    """Return how far off each contender's stop was, over all scenes that it stopped on."""
    named = []
    for name in found[0].curves:
        errors = [tables.stops(one)[name].error for one in found]
        off = [abs(error) for error in errors if error is not None]
        if off:
            goal = f"at most {tables.GOAL}"
            named.append(report.figure(f"{name}: off from the true spp", off, "ratio", goal=goal))
    return named


def _folder() -> Path:
    return report.RESULTS / "paper"


if __name__ == "__main__":
    main()
