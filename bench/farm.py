"""The whole farm against Mitsuba alone at its fastest: `make bench-farm`.

`plateau render` starts Redis, API, monitor and a worker, renders, merges, judges and writes its
results. One Mitsuba process renders as many samples of the same scene and writes nothing, in calls
of the size that is fastest for it. Both live at once and run in turns, on all cores, with compiled
kernels at hand; each has a clock of its own.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from bench.support import markdown
from bench.support.calls import CALLS_SPP, Case, call_rates, calls_that_fit
from bench.support.pairs import Pair, Run, Work, render_pair, warm_up
from bench.support.report import (
    OTHERS,
    Figure,
    figure,
    last_figures,
    last_report,
    others_figure,
    write_report,
)
from bench.support.turns import TURN_S
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.scenes import FOLDER, NAMES
from plateau.worker.supervisor.variants import choose

if TYPE_CHECKING:
    from collections.abc import Sequence

_SIZES = ((128, 128), (256, 256), (512, 512), (1920, 1080))
_QUICK_SIZES = ((128, 128), (512, 512))
EFFICIENCY = "efficiency: samples per second once under way, merged and judged"
CPU = "CPU time of a sample once under way"
WHOLE = "samples per second from the command line to the results"
WHOLE_CPU = "CPU time of a sample from the command line to the results"
FARM, BARE = "the farm's samples per second", "the bare renderer's samples per second"
MONITOR = "the monitor's share of the farm's CPU time, once under way"
_BARE = "one Mitsuba process that renders in calls of its best size and writes nothing"
#: The ratios, farm to bare renderer: of what, and the goal.
_RATIOS: dict[str, tuple[Callable[[Run], float], str | None]] = {
    EFFICIENCY: (lambda run: run.samples_s, "at least 0.97"),
    CPU: (lambda run: run.sample_cpu_s, "at most 1.04"),
    WHOLE: (lambda run: run.whole_samples_s, None),
    WHOLE_CPU: (lambda run: run.whole_sample_cpu_s, None),
}


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How long each case is measured."""

    pairs: int = 3
    seconds: float = 60.0  #: of a run's own time, unless four steps take longer
    step: int = JobSpec().step
    rounds: int = 3  #: of the calibration
    samples: int = 2**22  #: of each size of call in a round, unless one call has more
    turn_s: float = TURN_S


_QUICK = Effort(pairs=1, seconds=10, step=50, rounds=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument(
        "--sizes", nargs="+", type=_size, metavar="WIDTHxHEIGHT", help="default: four sizes"
    )
    parser.add_argument("--pairs", type=int, help="pairs of runs of each case (default: 3)")
    parser.add_argument(
        "--seconds", type=float, help="of one run, unless four steps take longer (default: 60)"
    )
    parser.add_argument("--step", type=int, help="spp between evaluations (default: 100)")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="one pair of 10 s, step 50, 128x128 and 512x512 alone; writes farm-quick.json",
    )
    options = parser.parse_args()
    asked = {
        name: value
        for name in ("pairs", "seconds", "step")
        if (value := getattr(options, name)) is not None
    }
    effort = replace(_QUICK if options.quick else Effort(), **asked)
    sizes = options.sizes or (_QUICK_SIZES if options.quick else _SIZES)

    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    cases = [
        Case(scene=FOLDER / scene, width=width, height=height, choice=choice, threads=threads)
        for width, height in sizes
        for scene in options.scenes
    ]
    measured = {case.name: measure(case, effort) for case in cases}
    name = "farm-quick" if options.quick else "farm"
    settings = {case: settings for case, (settings, _) in measured.items()}
    others = [one for one in last_figures(name) if one.name.partition(":")[0] not in measured]
    report = write_report(
        name,
        [*(one for _, figures in measured.values() for one in figures), *others],
        settings={
            "cases": {**last_report(name)["settings"].get("cases", {}), **settings},
            "turn_s": effort.turn_s,
            "variant": choice.variant,
            "workers": 1,
            "threads": threads,
        },
        notes=[
            "The rule is fixed at the cap, so no sample is rendered only to be thrown away.",
            "The farm is under way from its second point to the last but one.",
            "The bare renderer is under way from the end of its first call.",
            "The calibration and a first run of each compile the kernels; they are not counted.",
            "A run's seconds are those of its own turns; in the other's it is stopped.",
            "Work that the farm does by the clock falls on its own seconds twice as often.",
            "Only render children are niced: other work on the cores slows the farm more.",
        ],
    )
    if not options.quick:
        markdown.fill(markdown.DOCS / "performance.md", tables(report))


def measure(case: Case, effort: Effort) -> tuple[dict[str, Any], list[Figure]]:
    """Return what a case was rendered with, and its figures, whose names begin with the case's."""
    work, rates = plan(case, effort)
    warm_up(work)
    pairs = []
    for number in range(effort.pairs):
        pairs.append(render_pair(work, effort.turn_s))
        print(f"{case.name}, pair {number + 1} of {effort.pairs}: {pairs[-1]}", file=sys.stderr)
    settings = {
        "spp": work.spp,
        "step": work.step,
        "slice_spp": JobSpec().slice_spp,
        "call_spp": work.call_spp,
        "samples_s_by_call_spp": {str(spp): round(rate) for spp, rate in rates.items()},
    }
    return settings, [replace(one, name=f"{case.name}: {one.name}") for one in _figures(pairs)]


def plan(case: Case, effort: Effort) -> tuple[Work, dict[int, float]]:
    """Return how much is rendered, in which calls, and samples per second by the spp of a call."""
    tried = {"samples": effort.samples, "rounds": effort.rounds}
    [first] = call_rates(case, calls_that_fit(case, 3 * CALLS_SPP[0]), **tried).values()
    steps = round(effort.seconds * first / case.pixels / effort.step)
    spp = effort.step * max(4, steps)
    rates = call_rates(case, calls_that_fit(case, spp), **tried)
    call_spp = max(rates, key=rates.__getitem__)
    print(f"{case.name}: {spp} spp, {rates} samples/s by the spp of a call", file=sys.stderr)
    return Work(**vars(case), spp=spp, step=effort.step, call_spp=call_spp), rates


def _figures(pairs: Sequence[Pair]) -> list[Figure]:
    return [
        *(
            figure(
                name,
                [of(pair.farm) / of(pair.bare) for pair in pairs],
                "ratio",
                compared_with=_BARE,
                goal=goal,
            )
            for name, (of, goal) in _RATIOS.items()
        ),
        figure(MONITOR, [pair.monitor for pair in pairs], "of the CPU time", goal="under 0.02"),
        others_figure([pair.others for pair in pairs]),
        figure(FARM, [pair.farm.samples_s for pair in pairs], "samples/s"),
        figure(BARE, [pair.bare.samples_s for pair in pairs], "samples/s"),
        figure(
            f"{FARM}, start and end included", [p.farm.whole_samples_s for p in pairs], "samples/s"
        ),
        figure(
            f"{BARE}, start and end included", [p.bare.whole_samples_s for p in pairs], "samples/s"
        ),
    ]


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return a report as Markdown: the machine, and each case's efficiency and cost."""
    found = {one["name"]: one for one in report["figures"]}
    machine, settings = report["machine"], report["settings"]

    def cell(case: str, name: str) -> str:
        return markdown.spread(found[f"{case}: {name}"], 3)

    def rate(case: str, name: str) -> str:
        return f"{found[f'{case}: {name}']['value'] / 1e6:.2f}"

    rows = [
        [
            f"{case}, {of['spp']} spp",
            str(found[f"{case}: {EFFICIENCY}"]["spread"]["runs"]),
            str(of["call_spp"]),
            rate(case, BARE),
            rate(case, FARM),
            *(cell(case, name) for name in (EFFICIENCY, CPU, WHOLE, MONITOR, OTHERS)),
        ]
        for case, of in settings["cases"].items()
    ]
    head = ["", "pairs of runs", "spp of a bare call", "bare, 10⁶ samples/s", "farm, 10⁶ samples/s"]
    head += ["efficiency", "CPU time of a sample", "from start to results"]
    head += ["the monitor's share", "other work on the cores"]
    about = [f"{machine['cpu']}, {machine['os']}", machine["cores"]]
    about += [settings[name] for name in ("variant", "workers", "threads")]
    return {
        "farm-machine": markdown.table(
            ["machine", "cores", "variant", "workers", "threads"], [list(map(str, about))]
        ),
        "farm": markdown.table(head, rows),
    }


def _size(text: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT."""
    width, height = map(int, text.split("x"))
    return width, height


if __name__ == "__main__":
    main()
