"""The cost of one sample per pixel of a scene, rendered without a farm."""

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
    """The cost of rendering."""

    spp_s: list[float]  #: core seconds of one sample in every pixel, slice by slice
    others: float  #: other work's share of the cores meanwhile


def render_rate(scene: Path, parameters: Mapping[str, str], slice_spp: int) -> RenderRate:
    """Have one Mitsuba process render slices of a scene on all cores, and return the cost.

    `scene` is a folder with a ``scene.xml``; `width` and `height` are among its `parameters`.
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
