"""Mitsuba alone: one process that renders passes one after the other, and how fast it does."""

import json
import os
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, chain, pairwise
from pathlib import Path
from typing import IO, Any, Final

import psutil

from bench import ROOT
from bench.support.processes import timed
from plateau.farm.model.seeds import Pass, SeedSchedule
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.child_start import NICE
from plateau.worker.supervisor.variants import VariantChoice, choose

#: The spp of a call that are tried.
CALLS_SPP: Final = (16, 32, 64, 128, 256)
#: Samples of the largest call: some 2 GB of a JIT variant's memory.
LARGEST_CALL: Final = 2**26
#: The first slice is not counted: kernels are compiled in it.
_SLICES: Final = 5


@dataclass(frozen=True, kw_only=True)
class Alone:
    """The work of one Mitsuba process."""

    scene: Path  #: a folder with a ``scene.xml``
    parameters: Mapping[str, str]  #: of the scene
    passes: Iterable[Pass]
    variant: str
    llvm_library: str | None
    threads: int
    cache: Path  #: the worker's; its home has the kernels that Dr.Jit has compiled
    nice: int = 0  #: its priority beside other work on the cores
    image: Path | None = None  #: an .npy file for the image, which is otherwise dropped
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)

    def render(self) -> dict[str, Any]:
        """Return the answer of `bench.support.bare`; raise `ChildProcessError` if it failed."""
        with tempfile.TemporaryFile() as told:
            process = self.start(told)
            if process.wait():
                raise ChildProcessError(f"Mitsuba alone: exit code {process.returncode}")
            return read_told(told)

    def start(self, told: IO[bytes]) -> psutil.Popen:
        """Start the process; it writes its answer, for `read_told`, into the file."""
        request = {
            "variant": self.variant,
            "threads": self.threads,
            "folder": str(self.scene),
            "parameters": dict(self.parameters),
            "passes": list(self.passes),
            "image": None if self.image is None else str(self.image),
        }
        home = self.cache / "home"
        home.mkdir(parents=True, exist_ok=True)
        own = {"HOME": str(home)}
        if self.llvm_library is not None:
            own["DRJIT_LIBLLVM_PATH"] = self.llvm_library
        with tempfile.TemporaryFile() as asked:
            asked.write(json.dumps(request).encode())
            asked.seek(0)
            process = psutil.Popen(
                [sys.executable, "-m", "bench.support.bare"],
                cwd=ROOT,
                env={**self.environment, **own},
                stdin=asked,
                stdout=told,
            )
        process.nice(self.nice)  # long before its first thread renders
        return process


def read_told(told: IO[bytes]) -> dict[str, Any]:
    """Return the answer of a process that has ended."""
    told.seek(0)
    answer: dict[str, Any] = json.load(told)
    return answer


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

    A round renders this many samples with each size of call, or one call if that has more.
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


def spp_costs(
    scene: Path, parameters: Mapping[str, str], slice_spp: int
) -> tuple[list[float], float]:
    """Return the core seconds of one sample in every pixel, slice by slice.

    And the share of the cores that other work took meanwhile. The slices are rendered on all cores.
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
    return [(end - start) * threads / slice_spp for start, end in pairwise(ends)], took.others
