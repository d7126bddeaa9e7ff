"""The paper's experiment on our own scenes and our own farm: `make bench-paper`.

For each scene the farm renders a series of slices and an independent reference; every rule then
judges the same slices. Renders are kept in a folder, so that a run that was stopped goes on, and
images are judged anew without being rendered. At 256×256 and 10,000 spp it takes about as long as
rendering 10.5 thousand million samples does, and 2 GB of disk.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from bench.experiment import plots, tables
from bench.experiment.cases import FAMILIES, Case, cases
from bench.experiment.renders import SLICE_SPP, Size, rendered
from bench.experiment.series import STEPS, Measured, measure
from bench.experiment.truth import TARGET
from bench.support import report
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
    parser.add_argument("--scenes", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--workers", type=int, default=1, help="worker processes (1)")
    parser.add_argument(
        "--data", type=Path, default=_ROOT / "paper-data", help="folder of renders (./paper-data)"
    )
    options = parser.parse_args()
    if options.cap % max(STEPS) or options.cap < max(STEPS):
        parser.error(f"--cap must be a multiple of {max(STEPS)}, not {options.cap}")
    run(
        cases(tuple(options.scenes)),
        Size(options.size, options.cap),
        options.data,
        workers=options.workers,
    )


def run(scenes: list[Case], size: Size, data: Path, *, workers: int) -> list[Measured]:
    """Render what is not rendered yet, judge all of it, and write tables, pictures and report."""
    data.mkdir(parents=True, exist_ok=True)
    found = []
    for case in scenes:
        renders = rendered(case, size, data, workers=workers)
        started = time.monotonic()
        found.append(measure(renders))
        print(f"{case.name}: judged in {time.monotonic() - started:.0f} s", file=sys.stderr)
    write(found, report.RESULTS / "paper")
    write_report(
        "paper",
        figures(found),
        settings={
            "size": f"{size.pixels}×{size.pixels}",
            "cap": size.cap,
            "reference_spp": size.cap,
            "slice_spp": SLICE_SPP,
            "steps": list(STEPS),
            "scenes": [case.name for case in scenes],
        },
        notes=_NOTES,
    )
    return found


def write(found: list[Measured], folder: Path) -> None:
    """Write every series, the tables and the pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for one in found:
        one.write(folder / f"{one.slug}.json")
    for name, text in tables.all_tables(found).items():
        (folder / f"{name}.md").write_text(text)
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
        known = [abs(error) for error in errors if error is not None]
        if known:
            named.append(
                report.figure(
                    f"{name}: off from the true spp", known, "ratio", goal=f"at most {tables.GOAL}"
                )
            )
    return named


if __name__ == "__main__":
    main()
