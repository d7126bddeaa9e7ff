"""What our stopping rules and those of others save: `make bench-savings`.

For all eight scenes of the experiment: the machine time until a rule stops, relative to that of the
fixed 10,000 spp, and how many pixels are then still visibly wrong. The rules are our `visible` and
`reverse`, LuxCore's halt rule, and Cycles' noise threshold, all on the same slices.

It uses the renders of `make bench-paper`, the longest of each scene, and makes those that are
missing. Then it renders a few slices of each scene again, alone, to time them. The results keep
each scene's measurements, so that scenes can be run one after the other.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from bench.experiment import options
from bench.experiment.cases import Case
from bench.experiment.contenders import TARGET
from bench.experiment.costs import add_costs
from bench.experiment.renders import SLICE_SPP, Size, longest, rendered
from bench.experiment.savings_plot import plot_savings
from bench.experiment.savings_tables import cost_table, scene_tables, summary_table, time_ratios
from bench.experiment.spending import FIXED, FIXED_SPP, RULES, Spending, spend
from bench.support import markdown, report
from bench.support.report import Figure, write_report
from plateau.farm.model.spec import JobSpec

_NOTES = (
    "Machine time is core seconds: of one spp times the spp, and of an evaluation times those.",
    "It leaves out what all have in common: loading, merging, reading and writing.",
    f"LuxCore's rule is evaluated every {SLICE_SPP} or {2 * SLICE_SPP} spp, Cycles' at the latter.",
    "Pixels still visibly wrong are counted by the VDP, against the independent reference.",
    "Its noise is subtracted if the series is long enough, and otherwise included.",
)


def main() -> None:
    asked = options.parse(__doc__, step=2 * SLICE_SPP)
    found = run(asked.cases, asked.size, asked.data, workers=asked.workers)
    markdown.fill(markdown.DOCS / "savings.md", tables_of(found))
    plot_savings(found, markdown.DOCS.parent / "images" / "savings.png")


def run(todo: list[Case], size: Size, data: Path, *, workers: int) -> list[Spending]:
    """Judge and time these scenes, and report on all that the results hold."""
    data.mkdir(parents=True, exist_ok=True)
    folder = _folder()
    folder.mkdir(parents=True, exist_ok=True)
    for case in todo:
        renders = rendered(case, longest(case, size.pixels, data) or size, data, workers=workers)
        started = time.monotonic()
        one = spend(renders)
        add_costs(one, renders)
        one.write(folder / f"{case.slug}.json")
        print(f"{case.name}: took {time.monotonic() - started:.0f} s", file=sys.stderr)
    found = known()
    write_report(
        "savings",
        [figure for one in found for figure in figures(one)],
        settings={
            "slice_spp": SLICE_SPP,
            "step": JobSpec().step,
            "fixed_spp": FIXED_SPP,
            "target": TARGET,
            "scenes": {
                one.name: {"size": f"{one.pixels}×{one.pixels}", "cap": one.cap} for one in found
            },
        },
        notes=_NOTES,
    )
    return found


def known() -> list[Spending]:
    """Return every series that the results hold, in the order of the paper's tables."""
    return [Spending.read(path) for path in sorted(_folder().glob("*.json"))]


def tables_of(found: list[Spending]) -> dict[str, str]:
    """Return every table by the name of its place in the document."""
    return {
        "savings-summary": summary_table(found),
        "savings-scenes": scene_tables(found),
        "savings-costs": cost_table(found),
    }


def figures(one: Spending) -> list[Figure]:
    """Return the figures of one scene."""
    fixed = [FIXED_SPP * spp_s for spp_s in one.spp_s]
    named = [report.figure(f"{one.name}: {FIXED}", fixed, "core seconds")]
    for rule in RULES:
        stop = one.stops[rule]
        about = f"{one.name}: {rule}" + ("" if stop.ended else ", not ended by the cap")
        named += [
            Figure(name=f"{about}: spp", value=round(stop.spp, 1), unit="spp"),
            report.figure(
                f"{about}: machine time", time_ratios(one, rule), "ratio", compared_with=FIXED
            ),
            Figure(
                name=f"{about}: visibly wrong", value=round(one.left(rule).pixels, 1), unit="pixels"
            ),
        ]
    return named


def _folder() -> Path:
    return report.RESULTS / "savings"


if __name__ == "__main__":
    main()
