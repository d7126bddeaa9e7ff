"""What our stopping rules and those of others save: `make bench-savings`.

For all eight scenes of the experiment: the machine time until a rule stops, relative to that of the
fixed 10,000 spp, and how many pixels are then still visibly wrong. The rules are our `visible` and
`reverse`, LuxCore's halt rule, and Cycles' noise threshold, all on the same slices.

It uses what `make bench-paper` has found, and renders a few slices of each scene again, by
themselves, to time them.
"""

import math
import statistics
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from typing import Final

import numpy as np

from bench.support import series
from bench.support.alone import spp_costs
from bench.support.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt
from bench.support.processes import cpu_s
from bench.support.recordings import PAPER
from bench.support.report import Table, write_report
from bench.support.series import CYCLES, CYCLES_ADAPTIVE, SLICE_SPP, TARGET, Rendered, Series, Stop
from plateau import scenes
from plateau.farm.images.exr import decode_partial
from plateau.farm.model.spec import JobSpec
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.picture.judge import Judge, warm_up
from plateau.picture.merge import Merge

#: The basis of comparison: this many spp, whatever the image looks like.
FIXED_SPP: Final = 10_000
#: In the order of the tables: how a document names a rule, its stop, and whose evaluations it has.
RULES: Final = {
    "`visible`": ("visible @100", "ours"),
    "`visible`, 0.1 %": ("visible, 0.1 % @100", "ours"),
    "`reverse`": ("reverse @100", "ours"),
    "LuxCore, every 50 spp": ("LuxCore, every 50 spp", "luxcore"),
    "LuxCore, every 100 spp": ("LuxCore, every 100 spp", "luxcore"),
    CYCLES: (CYCLES, CYCLES),
    CYCLES_ADAPTIVE: (CYCLES_ADAPTIVE, CYCLES_ADAPTIVE),
}
#: More than this share wrong is a false stop.
_FALSE: Final = 3 * TARGET
#: How many evaluations are timed; the first is not counted.
_LOOKS: Final = 8


def main() -> None:
    asked = series.parse(__doc__)
    known = {one.name: one for one in series.known()}
    for case in asked.cases:
        one = known[case.name]
        size = series.Size(one.pixels, one.cap)
        renders = series.rendered(case, size, asked.data, workers=asked.workers)
        folder = scenes.FOLDER / case.family
        one.spp_s, one.others = spp_costs(folder, renders.parameters, SLICE_SPP)
        one.look_s = look_costs(renders)
        series.keep(one, case)
    found = series.known()
    write_report(
        "savings",
        {"savings-summary": summary_table(found), "savings-costs": cost_table(found)},
        settings={
            "slice_spp": SLICE_SPP,
            "step": JobSpec().step,
            "fixed_spp": FIXED_SPP,
            "target": TARGET,
        },
        notes=[
            "Machine time is core seconds: of one spp times the spp, and of evaluations.",
            "It leaves out what all have in common: loading, merging, reading and writing.",
            "Pixels still visibly wrong are counted by the VDP, against the reference.",
            "Its noise is subtracted if the series is long enough, and otherwise included.",
        ],
        document="savings.md",
    )


def look_costs(renders: Rendered) -> dict[str, list[float]]:
    """Return the core seconds of evaluating a series' first images, by whose rule.

    For our rules that is all the work of a job at a point of its curve: both rules, the estimate,
    the forecast and the zones.
    """
    spec = JobSpec.model_validate({"rule": "visible", "watch": (), "view": "paper"})
    metric, judge = CompiledVisibleDifferences(PAPER), Judge(spec)
    luxcore, cycles, adaptive = LuxCoreHalt(metric.view), CyclesThreshold(), CyclesAdaptive()
    merge = Merge(slice_spp=SLICE_SPP)
    took: dict[str, list[float]] = {}
    warm_up()
    films = (decode_partial(path.read_bytes()).pixels for path in sorted(renders.slices.iterdir()))
    for first, second in islice(zip(films, films, strict=False), _LOOKS):
        merge.add(first)
        merge.add(second)
        seen = series.evidence(merge, metric)
        assert seen.halves is not None
        looks: dict[str, Callable[[], object]] = {
            "ours": partial(judge.judge, merge),
            "luxcore": partial(luxcore.stops, seen.spp, seen.image),
            CYCLES: partial(cycles.stops, seen.spp, seen.image, seen.halves[0].mean),
            CYCLES_ADAPTIVE: partial(adaptive.add, first, second, 2 * SLICE_SPP),
        }
        for name, look in looks.items():
            took.setdefault(name, []).append(cpu_s(look))
    return {name: times[1:] for name, times in took.items()}


def left(one: Series, stop: Stop, *, evenly: bool = True) -> tuple[float, str]:
    """Return how many pixels were still visibly wrong, and how that is known.

    It is without the noise of the reference; docs/science/paper.md says how. If pixels differ in
    spp, that noise is taken to add as much as to an image whose samples are spread evenly. Late in
    a series its part is unknown, and the count against the reference is an upper bound.
    """
    true = one.truth_at(stop.spp)
    if true is None or not stop.seen:
        return stop.seen, "at most" if stop.seen else ""
    if evenly:
        return true, ""
    seen_evenly = float(np.interp(np.log(stop.spp), np.log(one.spp), one.truth))
    return stop.seen * true / max(seen_evenly, 1.0), "about"


def left_by(one: Series, rule: str) -> tuple[float, str]:
    """Return the same of where a rule left the image."""
    return left(one, one.stops[RULES[rule][0]], evenly=rule != CYCLES_ADAPTIVE)


def time_ratio(one: Series, rule: str) -> float:
    """Return a rule's machine time over that of the fixed samples, the median of timed slices."""
    name, whose = RULES[rule]
    looking_s = one.stops[name].looks * statistics.median(one.look_s[whose])
    return statistics.median(
        (one.stops[name].spp * spp_s + looking_s) / (FIXED_SPP * spp_s) for spp_s in one.spp_s
    )


def summary_table(every: Sequence[Series]) -> Table:
    """Return each rule's machine time over all scenes, and how often it left too much."""
    table = [
        [
            *("rule", "machine time, median", "least to most", "never stopped"),
            *(f"over {share:.1%} wrong" for share in (TARGET, _FALSE)),
            "most wrong",
        ]
    ]
    for rule, (name, _) in RULES.items():
        stops = [one.stops[name] for one in every]
        least = [time_ratio(one, rule) for one in every]
        # If the rule did not end the scene, its cost is only known to be at least this.
        most = [ratio if stop.ended else math.inf for ratio, stop in zip(least, stops, strict=True)]
        wrong = [
            (pixels / one.pixels**2, how) for one in every for pixels, how in [left_by(one, rule)]
        ]
        worst = max(wrong, key=lambda share_how: share_how[0])
        never = sum(not stop.ended for stop in stops)
        table.append(
            [
                rule,
                _bounds(statistics.median(least), statistics.median(most)),
                f"{min(least):.0%} to {_bounds(max(least), max(most))}",
                str(never) + (" to its last pixel" if never and rule == CYCLES_ADAPTIVE else ""),
                *(_over(share, wrong) for share in (TARGET, _FALSE)),
                f"{worst[1]} {worst[0]:.2%}".strip(),
            ]
        )
    return table


def cost_table(every: Sequence[Series]) -> Table:
    """Return what rendering and evaluating cost, scene by scene."""
    table = [["scene", "one spp", "one evaluation of ours", "LuxCore's", "Cycles'", "other work"]]
    for one in every:
        looks = [statistics.median(one.look_s[whose]) for whose in ("ours", "luxcore", CYCLES)]
        table.append(
            [
                one.name,
                f"{statistics.median(one.spp_s) * 1000:.0f} ms",
                *(f"{seconds * 1000:.3g} ms" for seconds in looks),
                f"{one.others:.0%}",
            ]
        )
    return table


def _bounds(least: float, most: float) -> str:
    return f"{least:.0%}" if least == most else f"over {least:.0%}"


def _over(share: float, wrong: Sequence[tuple[float, str]]) -> str:
    """Return in how many scenes more than a share is wrong, and how many are unsure."""
    over = [how for of_pixels, how in wrong if of_pixels > share]
    unsure = over.count("at most")
    return f"{len(over) - unsure}" + (f", {unsure} unsure" if unsure else "")


if __name__ == "__main__":
    main()
