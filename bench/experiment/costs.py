"""What rendering and evaluating cost on this machine, in core seconds."""

from __future__ import annotations

from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Final

from bench.experiment.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt
from bench.experiment.renders import SLICE_SPP
from bench.experiment.series import evidence
from bench.experiment.spending import CYCLES, CYCLES_ADAPTIVE, LUXCORE, OURS
from bench.support.bare.vdp_ways import cpu_s
from bench.support.render_rate import render_rate
from plateau import scenes
from plateau.farm.images.exr import decode_partial
from plateau.farm.model.spec import JobSpec
from plateau.metric import View
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.service.judging.judge import Judge, warm_up
from plateau.service.judging.merge import Merge

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.experiment.renders import Rendered
    from bench.experiment.spending import Spending

#: How many evaluations are timed; the first is not counted.
_LOOKS: Final = 8


def add_costs(spent: Spending, renders: Rendered) -> None:
    """Measure what rendering and evaluating a scene cost, and add it to `spent`."""
    rate = render_rate(scenes.FOLDER / renders.case.family, renders.parameters, slice_spp=SLICE_SPP)
    spent.spp_s, spent.others = rate.spp_s, rate.others
    spent.look_s = look_costs(renders)


def look_costs(renders: Rendered) -> dict[str, list[float]]:
    """Return the core seconds of evaluating a series' first images, by rule.

    For our rules that is all the work of a job at a point of its curve: both rules, the estimate,
    the forecast and the zones.
    """
    metric, judge = CompiledVisibleDifferences(View()), Judge(JobSpec())
    luxcore, cycles, adaptive = LuxCoreHalt(metric.view), CyclesThreshold(), CyclesAdaptive()
    merge = Merge(slice_spp=SLICE_SPP)
    took: dict[str, list[float]] = {"ours": [], "luxcore": [], CYCLES: [], CYCLES_ADAPTIVE: []}
    warm_up()
    films = (decode_partial(path.read_bytes()).pixels for path in sorted(renders.slices.iterdir()))
    for first, second in islice(zip(films, films, strict=False), _LOOKS):
        merge.add(first)
        merge.add(second)
        seen = evidence(merge, metric)
        assert seen.halves is not None
        looks: dict[str, Callable[[], object]] = {
            "ours": partial(judge.judge, merge),
            "luxcore": partial(luxcore.stops, seen.spp, seen.image),
            CYCLES: partial(cycles.stops, seen.spp, seen.image, seen.halves[0].mean),
            CYCLES_ADAPTIVE: partial(adaptive.add, first, second, 2 * SLICE_SPP),
        }
        for name, look in looks.items():
            took[name].append(cpu_s(look))
    counted = {name: times[1:] for name, times in took.items()}
    return {
        **dict.fromkeys(OURS, counted["ours"]),
        **dict.fromkeys(LUXCORE, counted["luxcore"]),
        CYCLES: counted[CYCLES],
        CYCLES_ADAPTIVE: counted[CYCLES_ADAPTIVE],
    }
