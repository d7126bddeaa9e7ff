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
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import accumulate
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil

from bench.support import markdown, plateau_render
from bench.support.alone import Alone, read_told
from bench.support.cores import machine_cpu_s
from bench.support.report import Figure, figure, write_report
from bench.support.turns import TURN_S, take_turns
from farm.exr import decode_image
from farm.seeds import Pass, SeedSchedule
from farm.settings import Settings
from farm.spec import JobSpec
from worker.variants import VariantChoice, choose

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

ROOT = Path(__file__).parents[1]
_SPEC = JobSpec()
#: Scene, size, spp and step. Larger films take fewer spp, and smaller steps, or a day.
_CASES = ("box:512x512:300:100", "bar:512x512:300:100", "box:1920x1080:150:50")
EFFICIENCY = "efficiency: spp per second once under way, merged and judged"
CPU = "CPU time of all processes"
MONITOR = "the monitor's share of the farm's CPU time, once under way"
OTHERS = "other work on the cores meanwhile"
_BARE = "one Mitsuba process that renders the same passes and writes nothing"


@dataclass(frozen=True, kw_only=True)
class Work:
    """What both render."""

    scene: Path
    width: int
    height: int
    spp: int
    step: int
    choice: VariantChoice
    threads: int

    @property
    def name(self) -> str:
        """How its figures call it."""
        return f"{self.scene.name} {self.width}×{self.height}"

    @property
    def parameters(self) -> dict[str, str]:
        """Values for the scene's ``$width`` and ``$height``."""
        return {"width": str(self.width), "height": str(self.height)}

    @property
    def slices(self) -> list[tuple[Pass, ...]]:
        """The passes of every slice, in order."""
        schedule = SeedSchedule(
            variant=self.choice.variant,
            width=self.width,
            height=self.height,
            slice_spp=_SPEC.slice_spp,
            max_spp=self.spp,
        )
        return list(map(schedule.passes, range(schedule.slices)))


@dataclass(frozen=True, kw_only=True)
class Run:
    """What one run took, in its own time."""

    #: spp per second, from the end of the second step to the end of the last. (What the monitor
    #: does once, on the first, would make the rest look faster.)
    steady_spp_s: float
    #: Seconds from the first lease, or from Mitsuba's import, until every sample was there.
    rendering_s: float
    #: Seconds from its start to its end.
    whole_s: float
    #: CPU seconds of the whole process, or process tree.
    cpu_s: float


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A run of the farm and one of the bare renderer, in turns."""

    farm: Run
    bare: Run
    #: The monitor's share of the farm's CPU time, from the end of the second step on.
    monitor: float
    #: How much of the cores everything else took meanwhile, this machine's host included.
    others: float


@dataclass(frozen=True, kw_only=True)
class Look:
    """CPU seconds that the farm's processes had used at one moment."""

    at: float  #: in seconds of `time.time`
    all_: float
    monitor: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=_case, nargs="+", default=list(map(_case, _CASES)))
    parser.add_argument("--pairs", type=int, default=3, help="runs of each")
    options = parser.parse_args()

    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    works = [Work(**case, choice=choice, threads=threads) for case in options.cases]
    figures = [one for work in works for one in measure(work, options.pairs)]
    path = write_report(
        "farm",
        figures,
        settings={
            "cases": {
                work.name: {"spp": work.spp, "step": work.step, "slice_spp": _SPEC.slice_spp}
                for work in works
            },
            "pairs": options.pairs,
            "turn_s": TURN_S,
            "variant": choice.variant,
            "workers": 1,
            "threads": threads,
        },
        notes=[
            "The rule is fixed at the cap, so no sample is rendered only to be thrown away.",
            "Efficiency is taken from the second point of the curve on, when all is under way.",
            "A first run of each is not counted; in it kernels are compiled and images compared.",
            "A run's seconds are those of its own turns; in the other's it is stopped.",
            "What a clock makes the farm do, it does twice as often in a second of its own.",
        ],
    )
    markdown.fill(markdown.DOCS / "performance.md", tables(json.loads(path.read_text())))


def measure(work: Work, pairs: int) -> list[Figure]:
    """Return what so many pairs of runs give, with the work's name in front."""
    _warm_up(work)
    ran = []
    for number in range(pairs):
        ran.append(_pair(work))
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
            "time from the first lease to the verdict on the last sample",
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
        [f"{case}, {settings['spp']} spp, step {settings['step']}"]
        + [cell(case, name) for name in (EFFICIENCY, CPU, MONITOR, OTHERS)]
        for case, settings in report["settings"]["cases"].items()
    ]
    machine, settings = report["machine"], report["settings"]
    return {
        "farm-machine": markdown.table(
            ["machine", "cores", "variant", "workers", "threads", "pairs of runs"],
            [
                [
                    f"{machine['cpu']}, {machine['os']}",
                    str(machine["cores"]),
                    settings["variant"],
                    str(settings["workers"]),
                    str(settings["threads"]),
                    str(settings["pairs"]),
                ]
            ],
        ),
        "farm": markdown.table(
            ["", "efficiency", "CPU time", "the monitor's share", "other work on the cores"], rows
        ),
    }


def _warm_up(work: Work) -> None:
    """Run both once, so that kernels are compiled; raises where they render different images."""
    work = replace(work, spp=work.step)
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "bare.npy"
        plateau_render.render(work.scene, Path(folder), **_asked_of_the_farm(work))
        replace(_alone(work), image=image).render()
        ours = decode_image((Path(folder) / "image.exr").read_bytes())
        if not np.allclose(ours, np.load(image), rtol=1e-4, atol=1e-6):
            raise AssertionError("the farm and the bare renderer do not render the same samples")


def _pair(work: Work) -> Pair:
    looks = []
    machine_s, started = machine_cpu_s(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as told_file:
        processes = {
            "the farm": plateau_render.start(work.scene, Path(folder), **_asked_of_the_farm(work)),
            "Mitsuba alone": _alone(work).start(told_file),
        }

        def look(name: str) -> None:
            if name == "the farm":
                looks.append(_look(processes[name]))

        ran = take_turns(processes, after_turn=look)
        job = json.loads((Path(folder) / "summary.json").read_text())
        told = read_told(told_file)
    cpu_s = sum(one.cpu_s for one in ran.values())
    cores_s = (time.monotonic() - started) * (psutil.cpu_count() or 1)

    def run(name: str, began: float, done: Mapping[int, float]) -> Run:
        """Of its own moments: when it began, and when so many spp were there."""
        own_s, (second, last) = ran[name].own_s, (2 * work.step, work.spp)
        return Run(
            steady_spp_s=(last - second) / (own_s(done[last]) - own_s(done[second])),
            rendering_s=own_s(done[last]) - own_s(began),
            whole_s=own_s(),
            cpu_s=ran[name].cpu_s,
        )

    done = {point["spp"]: _moment(point["at"]) for point in job["curve"]}
    spp = accumulate(one.spp for passes in work.slices for one in passes)
    ends = (told["started_at"] + ended_s for ended_s in told["ended_s"])
    return Pair(
        farm=run("the farm", _moment(job["started_at"]), done),
        bare=run("Mitsuba alone", told["started_at"], dict(zip(spp, ends, strict=True))),
        monitor=_monitors_share(looks, done[2 * work.step], done[work.spp]),
        others=max(0.0, machine_cpu_s() - machine_s - cpu_s) / cores_s,
    )


def _look(root: psutil.Process) -> Look:
    used = []
    for process in (root, *root.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):  # it ended a moment ago
            times = process.cpu_times()
            used.append((times.user + times.system, "monitor" in process.cmdline()))
    return Look(
        at=time.time(),
        all_=sum(seconds for seconds, _ in used),
        monitor=sum(seconds for seconds, is_monitor in used if is_monitor),
    )


def _monitors_share(looks: Sequence[Look], start: float, end: float) -> float:
    """Return the monitor's share of the CPU time, from the look before a moment to that after."""
    first = max((one for one in looks if one.at <= start), key=attrgetter("at"), default=looks[0])
    last = min((one for one in looks if one.at >= end), key=attrgetter("at"), default=looks[-1])
    return (last.monitor - first.monitor) / (last.all_ - first.all_)


def _asked_of_the_farm(work: Work) -> dict[str, Any]:
    return {
        "parameters": work.parameters,
        "options": {
            "--rule": "fixed",
            "--spp": work.spp,
            "--step": work.step,
            "--max-spp": work.spp,
            "--variant": work.choice.variant,
            "--threads": work.threads,
        },
    }


def _alone(work: Work) -> Alone:
    return Alone(
        scene=work.scene,
        parameters=work.parameters,
        slices=work.slices,
        variant=work.choice.variant,
        llvm_library=work.choice.llvm_library,
        threads=work.threads,
        cache=Settings().cache,
    )


def _moment(text: str) -> float:
    """Return a moment of a job in seconds of `time.time`."""
    return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()  # for Python 3.10


def _case(text: str) -> dict[str, Any]:
    """Parse SCENE:WIDTHxHEIGHT:SPP:STEP."""
    scene, size, spp, step = text.split(":")
    width, height = size.split("x")
    if int(spp) % int(step) or int(spp) < 3 * int(step) or int(step) % _SPEC.slice_spp:
        raise argparse.ArgumentTypeError(
            f"{text}: spp must be a multiple of the step, at least three of it, and the step one "
            f"of {_SPEC.slice_spp}"
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
