"""What one sample per pixel of a scene costs to render, without any farm around it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import accumulate, chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from bench.support.bare.alone import Alone
from bench.support.cores import timed
from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.variants import choose

if TYPE_CHECKING:
    from collections.abc import Mapping

#: The first slice is not counted: kernels are compiled in it.
_SLICES = 5


@dataclass(frozen=True)
class RenderRate:
    """What rendering takes."""

    #: Core seconds for one sample in every pixel, slice by slice.
    spp_s: list[float]
    #: Share of the cores that other work had meanwhile.
    others: float


def render_rate(scene: Path, parameters: Mapping[str, str], slice_spp: int) -> RenderRate:
    """Return what it takes one Mitsuba process, on all cores, to render slices of a scene.

    Parameters
    ----------
    scene
        A folder with a ``scene.xml``.
    parameters
        Values of its ``$parameters``, ``width`` and ``height`` among them.
    slice_spp
        Samples per pixel of a slice.
    """
    choice, threads = choose(Settings().cache), len(os.sched_getaffinity(0))
    schedule = SeedSchedule(
        variant=choice.variant,
        width=int(parameters["width"]),
        height=int(parameters["height"]),
        slice_spp=slice_spp,
        max_spp=_SLICES * slice_spp,
    )
    slices = [schedule.passes(index) for index in range(_SLICES)]
    with timed() as took:
        told = Alone(
            scene=scene,
            parameters=parameters,
            passes=chain.from_iterable(slices),
            variant=choice.variant,
            llvm_library=choice.llvm_library,
            threads=threads,
            cache=Settings().cache,
        ).render()
    ends = [told["ended_s"][last - 1] for last in accumulate(map(len, slices))]
    return RenderRate(
        spp_s=[(end - start) * threads / slice_spp for start, end in pairwise(ends)],
        others=took.others,
    )
