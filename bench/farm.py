"""The whole farm against the bare renderer: `make bench-farm`.

`plateau render` starts Redis, API, monitor and a worker, renders, merges, judges and writes its
results. One Mitsuba process renders the same passes of the same seeds and writes nothing. Both live
at once and run in turns, on all cores, with compiled kernels at hand; each has a time of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.support import markdown
from bench.support.pairs import SLICE_SPP, Pair, Run, Work, render_pair, warm_up
from bench.support.report import Figure, figure, last_figures, last_settings, write_report
from bench.support.turns import TURN_S
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.variants import choose

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

ROOT = Path(__file__).parents[1]
#: Scene, size, spp and step. Larger films take fewer spp, or a day.
_CASES = ("box:512x512:700:100", "bar:512x512:700:100", "box:1920x1080:500:100")
RENDERING = "time from the first lease to the verdict on the last sample"
EFFICIENCY = "efficiency: spp per second once under way, merged and judged"
CPU = "CPU time of all processes"
MONITOR = "the monitor's share of the farm's CPU time, once under way"
OTHERS = "other work on the cores meanwhile"
_BARE = "one Mitsuba process that renders the same passes and writes nothing"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=_case, nargs="+", default=list(map(_case, _CASES)))
    parser.add_argument("--pairs", type=int, default=3, help="runs of each")
    options = parser.parse_args()

    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    works = [Work(**case, choice=choice, threads=threads) for case in options.cases]
    measured = {
        work.name: {"spp": work.spp, "step": work.step, "slice_spp": SLICE_SPP} for work in works
    }
    figures = [one for work in works for one in measure(work, options.pairs)]
    others = [one for one in last_figures("farm") if one.name.partition(":")[0] not in measured]
    path = write_report(
        "farm",
        [*figures, *others],
        settings={
            "cases": {**last_settings("farm").get("cases", {}), **measured},
            "turn_s": TURN_S,
            "variant": choice.variant,
            "workers": 1,
            "threads": threads,
        },
        notes=[
            "The rule is fixed at the cap, so no sample is rendered only to be thrown away.",
            "Efficiency is taken from the second point of the curve to the last but one.",
            "A first run of each is not counted; in it kernels are compiled and images compared.",
            "A run's seconds are those of its own turns; in the other's it is stopped.",
            "What a clock makes the farm do, it does twice as often in a second of its own.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(json.loads(path.read_text())))


def measure(work: Work, pairs: int, turn_s: float = TURN_S) -> list[Figure]:
    """Return what so many pairs of runs give, with the work's name in front."""
    warm_up(work)
    ran = []
    for number in range(pairs):
        ran.append(render_pair(work, turn_s))
        print(f"{work.name}, pair {number + 1} of {pairs}: {ran[-1]}", file=sys.stderr)
    return [replace(one, name=f"{work.name}: {one.name}") for one in _figures(ran)]


def _figures(pairs: Sequence[Pair]) -> list[Figure]:
    def ratios(of: Callable[[Run], float]) -> list[float]:
        return [of(pair.farm) / of(pair.bare) for pair in pairs]

    return [
        figure(
            EFFICIENCY,
            ratios(lambda run: run.steady_spp_s),
            "ratio",
            compared_with=_BARE,
            goal="at least 0.97",
        ),
        figure(
            RENDERING,
            ratios(lambda run: run.rendering_s),
            "ratio",
            compared_with=f"{_BARE}, from its import of Mitsuba on",
        ),
        figure(
            "time from the command line to the results",
            ratios(lambda run: run.whole_s),
            "ratio",
            compared_with=_BARE,
        ),
        figure(CPU, ratios(lambda run: run.cpu_s), "ratio", compared_with=_BARE),
        figure(MONITOR, [pair.monitor for pair in pairs], "of the CPU time", goal="under 0.02"),
        figure(
            OTHERS,
            [pair.others for pair in pairs],
            "of the cores",
            goal="none, for figures to quote",
        ),
        figure("the farm's rate", [pair.farm.steady_spp_s for pair in pairs], "spp/s"),
        figure("the farm's whole time", [pair.farm.whole_s for pair in pairs], "s"),
        figure("the bare renderer's rate", [pair.bare.steady_spp_s for pair in pairs], "spp/s"),
        figure("the bare renderer's whole time", [pair.bare.whole_s for pair in pairs], "s"),
    ]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the machine, and each case's efficiency and cost."""
    found = {one["name"]: one for one in report["figures"]}

    def cell(case: str, name: str) -> str:
        one = found[f"{case}: {name}"]
        spread = one["spread"]
        return f"{one['value']:.3f} ({spread['lowest']:.3f} to {spread['highest']:.3f})"

    rows = [
        [
            f"{case}, {settings['spp']} spp, step {settings['step']}",
            str(found[f"{case}: {EFFICIENCY}"]["spread"]["runs"]),
        ]
        + [cell(case, name) for name in (EFFICIENCY, RENDERING, CPU, MONITOR, OTHERS)]
        for case, settings in report["settings"]["cases"].items()
    ]
    machine, settings = report["machine"], report["settings"]
    return {
        "farm-machine": markdown.table(
            ["machine", "cores", "variant", "workers", "threads"],
            [
                [
                    f"{machine['cpu']}, {machine['os']}",
                    str(machine["cores"]),
                    settings["variant"],
                    str(settings["workers"]),
                    str(settings["threads"]),
                ]
            ],
        ),
        "farm": markdown.table(
            [
                "",
                "pairs of runs",
                "efficiency",
                "time",
                "CPU time",
                "the monitor's share",
                "other work on the cores",
            ],
            rows,
        ),
    }


def _case(text: str) -> dict[str, Any]:
    """Parse SCENE:WIDTHxHEIGHT:SPP:STEP."""
    scene, size, spp, step = text.split(":")
    width, height = size.split("x")
    if int(spp) % int(step) or int(spp) < 4 * int(step) or int(step) % SLICE_SPP:
        raise argparse.ArgumentTypeError(
            f"{text}: spp must be a multiple of the step, at least four of it, and the step one "
            f"of {SLICE_SPP}"
        )
    return {
        "scene": ROOT / "scenes" / scene,
        "width": int(width),
        "height": int(height),
        "spp": int(spp),
        "step": int(step),
    }


if __name__ == "__main__":
    main()
