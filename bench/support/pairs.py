"""The farm and the bare renderer, which render the same passes in turns: a pair of runs."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.support.bare.alone import Alone, read_told
from bench.support.cores import timed
from bench.support.farms import plateau_render
from bench.support.turns import take_turns
from plateau.farm.images.exr import decode_image
from plateau.farm.model.seeds import Pass, SeedSchedule
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from plateau.worker.supervisor.variants import VariantChoice

SLICE_SPP = JobSpec().slice_spp


@dataclass(frozen=True, kw_only=True)
class Work:
    """What both render."""

    scene: Path
    width: int
    height: int
    spp: int
    step: int  #: four of them at least
    choice: VariantChoice
    threads: int

    @property
    def steady(self) -> tuple[int, int]:
        """From how many spp to how many all is under way: see `Run`."""
        return 2 * self.step, self.spp - self.step

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
            slice_spp=SLICE_SPP,
            max_spp=self.spp,
        )
        return list(map(schedule.passes, range(schedule.slices)))


@dataclass(frozen=True, kw_only=True)
class Run:
    """What one run took, in its own time."""

    #: spp per second, from the end of the second step to the end of the last but one. (What the
    #: monitor does once, on the first, would make the rest look faster, and beside what it does on
    #: the last nothing is rendered any more.)
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
    #: The monitor's share of the farm's CPU time, in those steps.
    monitor: float
    #: How much of the cores everything else took meanwhile, this machine's host included.
    others: float


def warm_up(work: Work) -> None:
    """Run both once, so that kernels are compiled; raises where they render different images."""
    work = replace(work, spp=work.step)
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "bare.npy"
        plateau_render.render(work.scene, Path(folder), **_asked_of_the_farm(work))
        replace(_alone(work), image=image).render()
        ours = decode_image((Path(folder) / "image.exr").read_bytes())
        if not np.allclose(ours, np.load(image), rtol=1e-4, atol=1e-6):
            raise AssertionError("the farm and the bare renderer do not render the same samples")


def render_pair(work: Work, turn_s: float) -> Pair:
    """Have both render the work, in turns of so many seconds."""
    with (
        tempfile.TemporaryDirectory() as folder,
        tempfile.TemporaryFile() as told_file,
        timed() as took,
    ):
        processes = {
            "the farm": plateau_render.start(work.scene, Path(folder), **_asked_of_the_farm(work)),
            "Mitsuba alone": _alone(work).start(told_file),
        }

        watch = plateau_render.Watch(processes["the farm"])

        def look(name: str) -> None:
            if name == "the farm":
                watch.look()

        ran = take_turns(processes, turn_s, after_turn=look)
        job = json.loads((Path(folder) / "summary.json").read_text())
        told = read_told(told_file)

    def run(name: str, began: float, done: Mapping[int, float]) -> Run:
        """Of its own moments: when it began, and when so many spp were there."""
        own_s, (first, last) = ran[name].own_s, work.steady
        return Run(
            steady_spp_s=(last - first) / (own_s(done[last]) - own_s(done[first])),
            rendering_s=own_s(done[work.spp]) - own_s(began),
            whole_s=own_s(),
            cpu_s=ran[name].cpu_s,
        )

    done = {point["spp"]: _moment(point["at"]) for point in job["curve"]}
    spp = accumulate(one.spp for passes in work.slices for one in passes)
    ends = (told["started_at"] + ended_s for ended_s in told["ended_s"])
    return Pair(
        farm=run("the farm", _moment(job["started_at"]), done),
        bare=run("Mitsuba alone", told["started_at"], dict(zip(spp, ends, strict=True))),
        monitor=watch.monitors_share(*(done[spp] for spp in work.steady)),
        others=took.others,
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
