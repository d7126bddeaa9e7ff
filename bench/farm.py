"""The whole farm against the bare renderer: `make bench-farm`.

`plateau render` starts Redis, API, monitor and a worker, renders, merges, judges and writes its
results. One Mitsuba process renders the same passes of the same seeds and writes nothing. Both run
in turns, on all cores, with compiled kernels at hand; each figure is a ratio of one pair.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.support.alone import render_alone
from bench.support.cores import Taken, timed
from bench.support.plateau_render import Look, monitors_share, render
from bench.support.report import Figure, figure, write_report
from farm.exr import decode_image
from farm.seeds import Pass, SeedSchedule
from farm.settings import Settings
from farm.spec import JobSpec
from worker.variants import VariantChoice, choose

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[1]
_SPEC = JobSpec()
#: Scene, size, spp and step. Larger films take fewer spp, and smaller steps, or a day.
_CASES = ("box:512x512:400:100", "bar:512x512:300:100", "box:1920x1080:200:50")
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
    """What one run took."""

    #: spp per second, from the end of the second step to the end of the last. (What the monitor
    #: does once, on the first, would make the rest look faster.)
    steady_spp_s: float
    #: Seconds from the first lease, or from Mitsuba's import, until every sample was there.
    rendering_s: float
    #: By the whole process, or process tree.
    took: Taken
    #: The monitor's share of all CPU time over the same stretch as `steady_spp_s`; 0 without one.
    monitor: float = 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=_case, nargs="+", default=list(map(_case, _CASES)))
    parser.add_argument("--pairs", type=int, default=3, help="runs of each")
    options = parser.parse_args()

    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    works = [Work(**case, choice=choice, threads=threads) for case in options.cases]
    figures = [one for work in works for one in _figures(work, _pairs(work, options.pairs))]
    write_report(
        "farm",
        figures,
        settings={
            "cases": {
                work.name: {"spp": work.spp, "step": work.step, "slice_spp": _SPEC.slice_spp}
                for work in works
            },
            "pairs": options.pairs,
            "variant": choice.variant,
            "workers": 1,
            "threads": threads,
        },
        notes=[
            "The rule is fixed at the cap, so no sample is rendered only to be thrown away.",
            "Efficiency is taken from the second point of the curve on, when all is under way.",
            "A first run of each is not counted; in it kernels are compiled and images compared.",
            "Where other work had a share of the cores, the spread is mostly its doing.",
        ],
    )


def _pairs(work: Work, count: int) -> list[tuple[Run, Run]]:
    """The farm's run and the bare renderer's, so many times."""
    _warm_up(work)
    pairs = []
    for number in range(count):
        # Whichever goes first alternates, so that a machine that slows down slows both.
        runs = {kind: kind(work) for kind in ((_farm, _bare), (_bare, _farm))[number % 2]}
        pairs.append((runs[_farm], runs[_bare]))
        print(f"{work.name}, pair {number + 1} of {count}: {pairs[-1]}", file=sys.stderr)
    return pairs


def _figures(work: Work, pairs: list[tuple[Run, Run]]) -> list[Figure]:
    def ratios(of: Callable[[Run], float]) -> list[float]:
        return [of(farm) / of(bare) for farm, bare in pairs]

    found = [
        figure(
            "efficiency: spp per second once under way, merged and judged",
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
            ratios(lambda run: run.took.wall_s),
            "ratio",
            compared_with=_BARE,
        ),
        figure(
            "CPU time of all processes",
            ratios(lambda run: run.took.cpu_s),
            "ratio",
            compared_with=_BARE,
        ),
        figure(
            "the monitor's share of the farm's CPU time, once under way",
            [farm.monitor for farm, _ in pairs],
            "of the CPU time",
            goal="under 0.02",
        ),
        figure(
            "other work on the cores meanwhile",
            [run.took.others for pair in pairs for run in pair],
            "of the cores",
            goal="none, for figures to quote",
        ),
        figure("the farm's rate", [farm.steady_spp_s for farm, _ in pairs], "spp/s"),
        figure("the farm's whole time", [farm.took.wall_s for farm, _ in pairs], "s"),
        figure("the bare renderer's rate", [bare.steady_spp_s for _, bare in pairs], "spp/s"),
        figure("the bare renderer's whole time", [bare.took.wall_s for _, bare in pairs], "s"),
    ]
    return [replace(one, name=f"{work.name}: {one.name}") for one in found]


def _warm_up(work: Work) -> None:
    """Run both once, so that kernels are compiled; raises where they render different images."""
    work = replace(work, spp=work.step)
    with tempfile.TemporaryDirectory() as folder:
        _render(work, Path(folder))
        ours = decode_image((Path(folder) / "image.exr").read_bytes())
        _ask_bare(work, image=Path(folder) / "bare.npy")
        theirs = np.load(Path(folder) / "bare.npy")
    if not np.allclose(ours, theirs, rtol=1e-4, atol=1e-6):
        raise AssertionError("the farm and the bare renderer do not render the same samples")


def _farm(work: Work) -> Run:
    with tempfile.TemporaryDirectory() as folder:
        with timed() as took:
            looks = _render(work, Path(folder))
        job = json.loads((Path(folder) / "summary.json").read_text())
    second, last = job["curve"][1], job["curve"][-1]
    start, end = _moment(second["at"]), _moment(last["at"])
    under_way = [look for look in looks if start <= look.at <= end]
    return Run(
        steady_spp_s=(last["spp"] - second["spp"]) / (end - start),
        rendering_s=end - _moment(job["started_at"]),
        monitor=monitors_share(under_way),
        took=took,
    )


def _bare(work: Work) -> Run:
    with timed() as took:
        told = _ask_bare(work, image=None)
    spp = list(accumulate(one.spp for passes in work.slices for one in passes))
    second, last = spp.index(2 * work.step), spp.index(work.spp)
    seconds = told["ended_s"][last] - told["ended_s"][second]
    return Run(
        steady_spp_s=(spp[last] - spp[second]) / seconds,
        rendering_s=told["ended_s"][last],
        took=took,
    )


def _render(work: Work, out: Path) -> list[Look]:
    return render(
        work.scene,
        out,
        parameters=work.parameters,
        options={
            "--rule": "fixed",
            "--spp": work.spp,
            "--step": work.step,
            "--max-spp": work.spp,
            "--variant": work.choice.variant,
            "--threads": work.threads,
        },
    )


def _ask_bare(work: Work, *, image: Path | None) -> dict[str, Any]:
    return render_alone(
        work.scene,
        work.parameters,
        work.slices,
        variant=work.choice.variant,
        llvm_library=work.choice.llvm_library,
        threads=work.threads,
        cache=Settings().cache,
        image=image,
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
