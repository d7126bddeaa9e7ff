"""The bare renderer at its fastest: how many samples per pixel each of its calls should have.

A call of Mitsuba costs some milliseconds besides its samples, which slows small calls of small
films. Large calls take memory, and have 2^32 samples at most.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Final

from bench.support.bare.alone import Alone
from plateau.farm.model.seeds import Pass
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.child_start import NICE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from plateau.worker.supervisor.variants import VariantChoice

#: The spp of a call that are tried.
CALLS_SPP: Final = (16, 32, 64, 128, 256)
#: Samples of the largest call: some 2 GB of a JIT variant's memory.
LARGEST_CALL: Final = 2**26


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene at one size, and what renders it."""

    scene: Path
    width: int
    height: int
    choice: VariantChoice
    threads: int

    @property
    def name(self) -> str:
        """Its name in the report."""
        return f"{self.scene.name} {self.width}×{self.height}"

    @property
    def pixels(self) -> int:
        """Pixels of the film."""
        return self.width * self.height

    @property
    def parameters(self) -> dict[str, str]:
        """Values for the scene's ``$width`` and ``$height``."""
        return {"width": str(self.width), "height": str(self.height)}

    def alone(self, calls: Iterable[int]) -> Alone:
        """Return the bare renderer with one call for each of these spp, each with its own seed.

        It has a render child's priority, so that other work slows neither of a pair more.
        """
        return Alone(
            scene=self.scene,
            parameters=self.parameters,
            passes=[Pass(spp, seed) for seed, spp in enumerate(calls)],
            variant=self.choice.variant,
            llvm_library=self.choice.llvm_library,
            threads=self.threads,
            cache=Settings().cache,
            nice=NICE,
        )


def calls_that_fit(case: Case, spp: int) -> list[int]:
    """Return the spp of calls that fit memory and three times or more into an image of `spp`."""
    most = min(LARGEST_CALL // case.pixels, spp // 3)
    return [one for one in CALLS_SPP if one <= most] or [max(1, most)]


def call_rates(
    case: Case, calls_spp: Sequence[int], *, samples: int, rounds: int
) -> dict[int, float]:
    """Return samples per second by the spp of a call, the best of some rounds over all of them.

    A round renders this many samples with each size of call, or one call if that has more. The
    first round compiles the kernels; with two or more it is hardly ever the best.
    """
    calls = {spp: max(1, samples // (spp * case.pixels)) for spp in calls_spp}
    readings = list(calls) * rounds
    told = case.alone(spp for spp in readings for _ in range(calls[spp])).render()
    moments = [told["began_s"], *told["ended_s"]]
    ends = accumulate((calls[spp] for spp in readings), initial=0)
    rates = defaultdict(list)
    for spp, (first, last) in zip(readings, pairwise(ends), strict=True):
        rendered = (last - first) * spp * case.pixels
        rates[spp].append(rendered / (moments[last] - moments[first]))
    return {spp: max(found) for spp, found in rates.items()}
