"""The farm and the bare renderer, which render the same scene in turns: a pair of runs."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from bench.support.bare.alone import read_told
from bench.support.calls import Case
from bench.support.cores import timed
from bench.support.farms import plateau_render
from bench.support.turns import Ran, take_turns
from plateau.farm.images.exr import decode_image

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
    whole_sample_cpu_s: float


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A run of the farm and one of the bare renderer, in turns."""

    farm: Run
    bare: Run
    monitor: float  #: its share of the farm's CPU time, once under way
    #: How much of the cores everything else took meanwhile, this machine's host included.
    others: float


def warm_up(work: Work) -> None:
    """Run both once, so that kernels are compiled; raise if their images differ in their means."""
    work = replace(work, spp=work.step)
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "bare.npy"
        plateau_render.render(work.scene, Path(folder), **_asked_of_the_farm(work))
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
        processes = {
            "the farm": plateau_render.start(work.scene, Path(folder), **_asked_of_the_farm(work)),
            "Mitsuba alone": work.alone(work.calls).start(told_file),
        }
        watch = plateau_render.Watch(processes["the farm"])
        ran = take_turns(processes, turn_s, look=watch.look)
        curve = json.loads((Path(folder) / "summary.json").read_text())["curve"]
        told = read_told(told_file)

    farm, monitor = _farm_run(work, ran["the farm"], watch, curve)
    return Pair(
        farm=farm,
        bare=_bare_run(work, ran["Mitsuba alone"], told),
        monitor=monitor,
        others=took.others,
    )


def _farm_run(
    work: Work, ran: Ran, watch: plateau_render.Watch, curve: list[dict[str, Any]]
) -> tuple[Run, float]:
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
        whole_sample_cpu_s=ran.cpu_s / whole,
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
