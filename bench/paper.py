"""The paper's experiment on our own scenes and our own farm: `make bench-paper`.

For each scene the farm renders a series of slices and an independent reference; every rule then
judges the same slices. Renders stay in a folder, so that a stopped run can continue and images can
be judged again. The results keep each scene's measurements, so that scenes can be run on different
days.

At 256×256 and 10,000 spp all eight take 10.5 thousand million samples and 2 GB of disk. The paper's
own size is --size 512.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from bench.experiment import options, plots, tables
from bench.experiment.cases import Case
from bench.experiment.contenders import TARGET
from bench.experiment.renders import SLICE_SPP, Size, rendered
from bench.experiment.series import STEPS, Measured, measure
from bench.support import markdown, report
from bench.support.report import Figure, write_report

_NOTES = (
    f"True: at most {TARGET:.1%} of the pixels differ visibly from the independent reference.",
    "The reference has noise of its own, so true is later than against a converged image.",
    "Every rule judges the same slices, at the default view and with its default parameters.",
    "No rule ends a series: each continues to the cap.",
)


def main() -> None:
    asked = options.parse(__doc__, step=max(STEPS))
    run(asked.cases, asked.size, asked.data, workers=asked.workers)
    for document in ("paper.md", "stopping.md"):
        markdown.fill(markdown.DOCS / document, tables_of(known()))


def run(todo: list[Case], size: Size, data: Path, *, workers: int) -> list[Measured]:
    """Render and judge these scenes, and report on all that the results hold."""
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
    """Return the error of each rule's stop, over all scenes on which it stopped."""
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
