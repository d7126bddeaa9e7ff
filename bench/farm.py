"""The whole farm against Mitsuba alone at its fastest: `make bench-farm`.

`plateau render` starts Redis, API, monitor and a worker, renders, merges, judges and writes its
results. One Mitsuba process renders as many samples of the same scene and writes nothing, in calls
of the size that is fastest for it. Both live at once and run in turns, on all cores, with compiled
kernels at hand; each has a clock of its own.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.support import processes
from bench.support.alone import CALLS_SPP, Case, call_rates, calls_that_fit, read_told
from bench.support.processes import TURN_S, Ran, Watch, take_turns, timed
from bench.support.recordings import Size
from bench.support.report import OTHERS, Table, machine_table, spread, write_report
from plateau.farm.images.exr import decode_image
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.scenes import FOLDER, NAMES
from plateau.worker.supervisor.variants import choose

_SIZES: Final = ((128, 128), (256, 256), (512, 512), (1920, 1080))
_QUICK_SIZES: Final = ((128, 128), (512, 512))
_NOTES: Final = (
    "The rule is fixed at the cap, so no sample is rendered only to be thrown away.",
    "The farm is under way from its second point to the last but one.",
    "The bare renderer is under way from the end of its first call.",
    "The calibration and a first run of each compile the kernels; they are not counted.",
    "A run's seconds are those of its own turns; in the other's it is stopped.",
    "Work that the farm does by the clock falls on its own seconds twice as often.",
    "Only render children are niced: other work on the cores slows the farm more.",
)

#: The mean of an image, the farm's beside the bare renderer's; their noise differs.
_SAME_MEAN = 0.05


@dataclass(frozen=True, kw_only=True)
class Work(Case):
    """How much of a case is rendered."""

    spp: int  #: a multiple of the step, four steps at least
    step: int
    call_spp: int  #: of the bare renderer's calls

    @property
    def calls(self) -> list[int]:
        """The spp of the bare renderer's calls, all alike; together `spp`, or a little more."""
        return [self.call_spp] * -(-self.spp // self.call_spp)


@dataclass(frozen=True, kw_only=True)
class Run:
    """One run by its own clock: samples per second, and CPU seconds of the process tree."""

    samples_s: float  #: once under way
    sample_cpu_s: float  #: for one sample, once under way
    whole_samples_s: float  #: from its start to its end


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A run of the farm and one of the bare renderer, in turns."""

    farm: Run
    bare: Run
    monitor: float  #: its share of the farm's CPU time, once under way
    #: How much of the cores everything else took meanwhile, this machine's host included.
    others: float


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
    parser.add_argument(
        "--scenes", nargs="+", default=NAMES, help="of Plateau's, or folders with a scene.xml"
    )
    parser.add_argument(
        "--sizes", nargs="+", type=Size.of, metavar="WIDTHxHEIGHT", help="default: four sizes"
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="one pair of 10 s, step 50, 128x128 and 512x512 only; writes farm-quick.json",
    )
    options = parser.parse_args()
    effort = _QUICK if options.quick else Effort()
    sizes = options.sizes or (_QUICK_SIZES if options.quick else _SIZES)

    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    about = {"variant": choice.variant, "workers": 1, "threads": threads}
    for width, height in sizes:
        for scene in options.scenes:
            folder = FOLDER / scene if scene in NAMES else Path(scene).resolve()
            case = Case(scene=folder, width=width, height=height, choice=choice, threads=threads)
            write_report(
                "farm-quick" if options.quick else "farm",
                {
                    "farm-machine": [row[:-1] for row in machine_table(about, [0])],
                    **measure(case, effort),
                },
                settings={**about, "turn_s": effort.turn_s},
                notes=_NOTES,
                document=None if options.quick else "performance.md",
                key=lambda cell: cell.partition(",")[0],
            )


def measure(case: Case, effort: Effort) -> dict[str, Table]:
    """Return the table of a case."""
    work = plan(case, effort)
    warm_up(work)
    pairs = []
    for number in range(effort.pairs):
        pairs.append(render_pair(work, effort.turn_s))
        print(f"{case.name}, pair {number + 1} of {effort.pairs}: {pairs[-1]}", file=sys.stderr)

    def ratio(name: str) -> str:
        return spread([getattr(one.farm, name) / getattr(one.bare, name) for one in pairs], 3)

    row = {
        "": f"{case.name}, {work.spp} spp",
        "pairs of runs": str(len(pairs)),
        "spp of a bare call": str(work.call_spp),
        "bare, 10⁶ samples/s": f"{statistics.median(p.bare.samples_s for p in pairs) / 1e6:.2f}",
        "efficiency": ratio("samples_s"),
        "CPU time of a sample": ratio("sample_cpu_s"),
        "from start to results": ratio("whole_samples_s"),
        "the monitor's share": f"{max(one.monitor for one in pairs):.3f}",
        OTHERS: f"{max(one.others for one in pairs):.3f}",
    }
    return {"farm": [list(row), list(row.values())]}


def plan(case: Case, effort: Effort) -> Work:
    """Return how much is rendered, and in which calls."""
    tried = {"samples": effort.samples, "rounds": effort.rounds}
    [first] = call_rates(case, calls_that_fit(case, 3 * CALLS_SPP[0]), **tried).values()
    steps = round(effort.seconds * first / case.pixels / effort.step)
    spp = effort.step * max(4, steps)
    rates = call_rates(case, calls_that_fit(case, spp), **tried)
    print(f"{case.name}: {spp} spp, {rates} samples/s by the spp of a call", file=sys.stderr)
    best = max(rates, key=rates.__getitem__)
    return Work(**vars(case), spp=spp, step=effort.step, call_spp=best)


def warm_up(work: Work) -> None:
    """Run both once, so that kernels are compiled; raise if their images differ in their means."""
    work = replace(work, spp=work.step)
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "bare.npy"
        processes.render(work.scene, Path(folder), **_asked_of_the_farm(work))
        replace(work.alone(work.calls), image=image).render()
        ours = decode_image((Path(folder) / "image.exr").read_bytes()).mean()
        theirs = np.load(image).mean()
    if not np.isclose(ours, theirs, rtol=_SAME_MEAN):
        raise AssertionError(f"the farm's image has a mean of {ours}, the bare one of {theirs}")


def render_pair(work: Work, turn_s: float) -> Pair:
    """Have both render the work, in turns of so many seconds."""
    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryFile() as told_file,
        timed() as took,
    ):
        both = {
            "the farm": processes.start(work.scene, Path(folder), **_asked_of_the_farm(work)),
            "Mitsuba alone": work.alone(work.calls).start(told_file),
        }
        watch = Watch(both["the farm"])
        ran = take_turns(both, turn_s, look=watch.look)
        curve = json.loads((Path(folder) / "summary.json").read_text())["curve"]
        told = read_told(told_file)

    farm, monitor = _farm_run(work, ran["the farm"], watch, curve)
    return Pair(
        farm=farm,
        bare=_bare_run(work, ran["Mitsuba alone"], told),
        monitor=monitor,
        others=took.others,
    )


def _farm_run(work: Work, ran: Ran, watch: Watch, curve: list[dict[str, Any]]) -> tuple[Run, float]:
    """Return the farm's run, and the monitor's share.

    The farm is under way from its second point to the last but one. What the monitor does once, on
    the first, would make the rest look faster, and nothing is rendered beside what it does on the
    last.
    """
    done = {point["spp"]: ran.own_s(_moment(point["at"])) for point in curve}
    first, last = 2 * work.step, work.spp - work.step
    looks_s = [ran.own_s(look.at) for look in watch.looks]

    def used_s(values: list[float]) -> float:
        """What was used between the two points, which come between looks."""
        before, after = np.interp([done[first], done[last]], looks_s, values)
        return float(after - before)

    cpu_s = used_s([look.all_ for look in watch.looks])
    run = _run(work, ran, work.spp, last - first, done[last] - done[first], cpu_s)
    return run, used_s([look.monitor for look in watch.looks]) / cpu_s


def _bare_run(work: Work, ran: Ran, told: dict[str, Any]) -> Run:
    """Return the bare renderer's run; it is under way from the end of its first call."""
    ends = [ran.own_s(told["started_at"] + told["ended_s"][call]) for call in (0, -1)]
    cpu_s = told["cpu_s"][-1] - told["cpu_s"][0]
    return _run(work, ran, sum(work.calls), sum(work.calls[1:]), ends[1] - ends[0], cpu_s)


def _run(work: Work, ran: Ran, spp: int, steady_spp: int, steady_s: float, cpu_s: float) -> Run:
    whole, steady = spp * work.pixels, steady_spp * work.pixels
    return Run(
        samples_s=steady / steady_s,
        sample_cpu_s=cpu_s / steady,
        whole_samples_s=whole / ran.own_s(),
    )


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


def _moment(text: str) -> float:
    """Return a moment of a job in seconds of `time.time`."""
    return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()  # for Python 3.10


if __name__ == "__main__":
    main()
