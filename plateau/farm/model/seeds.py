"""Which passes make up a slice, and the seed of each.

A slice is a fixed list of passes. Passes are counted through the whole job, and the number of a
pass decides its seed, so a slice is a pure function of the schedule and its index. Which seeds give
independent samples depends on the variant, see `plateau.farm.model.renderers`: most take any that
are distinct; Mitsuba's scalar variants and those that draw sequences do not.

**Mitsuba's JIT variants** (``llvm_*``, ``cuda_*``) are rendered by our kernel
(`plateau.worker.renderers.mitsuba.kernel`). It starts a sample's random numbers from a bijection of
64 bits, of the seed and of the sample's number in the pass. Distinct pairs get distinct generators,
so any distinct seeds will do.

**Mitsuba's scalar variants** (read in Mitsuba 3.9: ``src/render/integrator.cpp``,
``src/render/sampler.cpp``) start the pixel ``i`` of block ``b`` from the 32-bit sum

    seed · width · height  +  b · 32²  +  i        (mod 2**32)

and always on the same PCG32 stream. Three things follow:

1. A pass uses the numbers ``0 … 32² · blocks - 1`` above its start. Where the film's sides are no
   multiples of 32 that is more than ``width · height``: the next seed would start inside the range
   and reuse, in other pixels, random numbers of the pass before. Passes are therefore set apart by
   a whole range (``_ScalarSeeds.stride``).
2. The 32-bit sum wraps: a film of 512×512 has 2**14 disjoint passes. Where a job would need more,
   its passes grow, and where that is not enough it is refused (`SeedsExhausted`).
3. Two passes keep one *constant distance* on the stream in every pixel, and PCG32 draws a constant
   distance apart are faintly correlated (|r| up to 0.1 for one pair of 1-spp passes, either sign).
   Equally spaced starts repeat the same distances, and their correlations add up: at 333×255 the
   variance of 256 merged passes was 1.88 times what independence gives. Starts in a scrambled order
   repeat no distance, the signs cancel, and the factor was 1.02. Hence `_scramble`.

**Sequences**: a renderer may draw the samples of a pixel from low-discrepancy sequences, of which
it can render any stretch. Samples of one sequence lie apart from each other, so they are *not*
independent: the more there are, the more the difference of two halves of them exceeds the error of
their mean. A job therefore has two sequences, with scrambles of their own: one for the slices with
an even index, one for those with an odd one. These are the halves by which a monitor estimates the
noise that is left. A slice takes up its sequence where its predecessor of that half has ended, so
that its place does not depend on the job's cap. The seed of a pass is the number of its first
sample, counted through all sequences of all jobs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, chain, pairwise
from typing import NamedTuple

from plateau.farm.model.passes import (
    largest_single_call,
    passes_in_parts,
    single_call_passes,
)
from plateau.farm.model.renderers import variant_named

#: Mitsuba's own block size; the renderer pins it, since small films would otherwise be cut into
#: smaller blocks when more threads run, and the samples would depend on the machine.
SCALAR_BLOCK = 32

#: A job's seed is one of so many.
JOB_SEEDS = 2**12

#: Distinct seeds: the passes set aside for each job seed.
JIT_PASSES_PER_JOB_SEED = 2**32 // JOB_SEEDS

#: Sequences: the samples set aside for each of the two halves of a job.
SEQUENCE_SAMPLES = 2**32 // JOB_SEEDS // 2


class SeedsExhausted(ValueError):
    """The job would need more distinct sampler seeds than its variant and film size offer."""


class Pass(NamedTuple):
    """What is rendered with one seed.

    Attributes
    ----------
    spp : int
        Samples per pixel; a power of two for a renderer that renders passes in a single call.
    seed : int
        The 32-bit seed.
    """

    spp: int
    seed: int


class SeedRange(NamedTuple):
    """The numbers of one slice, both ends included; disjoint between a job's slices.

    They count passes in the variant's sequence of seeds, job seed included. A JIT pass's seed *is*
    its number; a scalar pass's seed is a one-to-one scramble of it. In sequences they count
    samples, and a pass's seed is the number of its first one.
    """

    first: int
    last: int


@dataclass(frozen=True)
class SeedSchedule:
    """The passes and seeds of every slice of a job, a pure function of plain values.

    Parameters
    ----------
    variant : str
        A variant of `plateau.farm.model.renderers`, by its stored name.
    width, height : int
        Size in pixels of the film as rendered (the crop window, if there is one).
    slice_spp : int
        Samples per pixel of each slice.
    max_spp : int
        The job's cap in samples per pixel.
    job_seed : int
        The job's seed, 0 or more. Jobs that differ in nothing else draw disjoint samples.
    most_slice_spp : int
        The most spp of a slice of zones, where the job is allocated by zones; 0 where it is not.
    frame_seed : int
        How much of `job_seed` tells a frame of a batch from the first one. Where the variant has
        too few seeds for all frames, they begin again at the first frame's.
    inputs : tuple of int
        Rising spp, at most `slice_spp`, at each of which a pass of the first slice ends.

    Raises
    ------
    SeedsExhausted
        The variant has too few distinct seeds for this job; the message says what to change.
    ValueError
        A value is out of its domain, or there is no such variant.
    """

    variant: str
    width: int
    height: int
    slice_spp: int
    max_spp: int
    job_seed: int = 0
    most_slice_spp: int = 0
    frame_seed: int = 0
    inputs: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for name in ("width", "height", "slice_spp", "max_spp"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if self.job_seed < 0:
            raise ValueError(f"job_seed must be 0 or more, not {self.job_seed}")
        if self.most_slice_spp and not variant_named(self.variant).renders_zones:
            raise SeedsExhausted(
                f"{self.variant} renders whole films alone, and the job is allocated by zones: "
                f"choose the allocation frame{', or an LLVM or CUDA variant' * self._seeds.scarce}"
            )
        needed, offered = self._passes_per_job, self._seeds.passes_per_job
        if needed > offered:
            raise SeedsExhausted(
                f"{self.max_spp} spp in slices of {self.slice_spp} take {needed} passes, and "
                f"{self._seeds.described} has distinct seeds for {offered}: {self._remedy}"
            )
        if self._draws_sequences and -(-self.slices // 2) * self.slice_spp > SEQUENCE_SAMPLES:
            raise SeedsExhausted(
                f"{self.max_spp} spp in slices of {self.slice_spp} are more than the two sequences "
                f"of {SEQUENCE_SAMPLES} samples that {self.variant} has for a job: lower max_spp "
                "or slice_spp"
            )
        if self._first_frames_seed >= self._job_seeds:
            raise SeedsExhausted(
                f"job seed {self._first_frames_seed} is too large: {self._seeds.described} has "
                f"distinct seeds for {self._job_seeds} such jobs, and job seeds 0 to "
                f"{self._job_seeds - 1} "
                "fit" + (f"; else {self._remedy}" if self._seeds.scarce else "")
            )

    @property
    def slices(self) -> int:
        """The number of slices that reach `max_spp`, if all are whole films."""
        return -(-self.max_spp // self.slice_spp)

    def pass_spp(self, index: int, spp: int | None = None) -> tuple[int, ...]:
        """Return the spp of each pass of slice `index`, in rendering order.

        `spp` is the slice's own, where it is one of zones.
        """
        if index == 0 and self.inputs:
            ends = pairwise(dict.fromkeys((0, *self.inputs, self.slice_spp)))
            return tuple(chain.from_iterable(self._divided(end - start) for start, end in ends))
        if variant_named(self.variant).renders_in_parts:
            return self._divided(spp or self.slice_spp, is_first=index == 0)
        return self._single_calls

    def _divided(self, spp: int, *, is_first: bool = False) -> tuple[int, ...]:
        if variant_named(self.variant).renders_in_parts:
            return passes_in_parts(spp, self.width * self.height, is_first=is_first)
        return single_call_passes(spp, self._single_calls[0])

    @cached_property
    def _single_calls(self) -> tuple[int, ...]:
        largest = largest_single_call(self.width * self.height)
        # Larger passes use fewer seeds, and a slower cancel is better than no job.
        while (
            self.slices * len(single_call_passes(self.slice_spp, largest))
            > self._seeds.passes_per_job
            and 2 * largest <= self.slice_spp
        ):
            largest *= 2
        return single_call_passes(self.slice_spp, largest)

    def seed_range(self, index: int, spp: int | None = None) -> SeedRange:
        """Return the pass numbers of slice `index`, for the ledger; `spp` as for `pass_spp`."""
        if not 0 <= index < self._most_slices:
            raise SeedsExhausted(f"slice {index} is outside the job's {self._most_slices} slices")
        job_seed = (self._first_frames_seed + self.frame_seed) % self._job_seeds
        reserved = job_seed * self._passes_per_job_seed
        if self._draws_sequences:
            half, place = index % 2, index // 2 * self.slice_spp
            first = reserved + half * SEQUENCE_SAMPLES + place
            return SeedRange(first, first + self.slice_spp - 1)
        first = reserved + self._passes_before(index)
        return SeedRange(first, first + len(self.pass_spp(index, spp)) - 1)

    @property
    def _most_slices(self) -> int:
        """The most slices; by zones, as many as there are seeds for."""
        if not self.most_slice_spp:
            return self.slices
        return self._seeds.passes_per_job // self._passes_before(1)

    def _passes_before(self, index: int) -> int:
        """Return how many passes are set aside for the slices before `index`."""
        if self.most_slice_spp:  # any spp may be asked of a slice of zones
            return index * (1 + len(self.pass_spp(1, max(self.most_slice_spp, self.slice_spp))))
        return len(self.pass_spp(0)) + (index - 1) * len(self.pass_spp(1)) if index else 0

    def passes(self, index: int, spp: int | None = None) -> tuple[Pass, ...]:
        """Return the passes of slice `index` in the order in which they are rendered and added.

        `spp` as for `pass_spp`.
        """
        first, last = self.seed_range(index, spp)
        each_spp = self.pass_spp(index, spp)
        if self._draws_sequences:
            starts = accumulate(each_spp[:-1], initial=first)
            return tuple(map(Pass, each_spp, starts))
        seeds = map(self._seeds.seed, range(first, last + 1))
        return tuple(map(Pass, each_spp, seeds))

    @property
    def _draws_sequences(self) -> bool:
        return variant_named(self.variant).seeds == "sequences"

    @cached_property
    def _seeds(self) -> _DistinctSeeds | _ScalarSeeds:
        if variant_named(self.variant).seeds == "scalar":
            return _ScalarSeeds(self.variant, self.width, self.height)
        return _DistinctSeeds(self.variant)

    @property
    def _passes_per_job(self) -> int:
        return self._passes_before(self.slices)

    @property
    def _passes_per_job_seed(self) -> int:
        return self._seeds.reserved(self._passes_per_job)

    @property
    def _first_frames_seed(self) -> int:
        return (self.job_seed - self.frame_seed) % JOB_SEEDS if self.frame_seed else self.job_seed

    @property
    def _job_seeds(self) -> int:
        return self._seeds.count // self._passes_per_job_seed

    @property
    def _remedy(self) -> str:
        remedy = "lower max_spp or raise slice_spp, so that the job takes fewer passes"
        return f"{remedy}, or use an LLVM variant" if self._seeds.scarce else remedy


class _DistinctSeeds:
    """Seeds of which any two give independent samples: the pass numbers themselves."""

    count = 2**32
    passes_per_job = JIT_PASSES_PER_JOB_SEED
    scarce = False

    def __init__(self, variant: str) -> None:
        self.described = variant

    def reserved(self, _needed: int) -> int:
        """Return the passes set aside for a job: always the same, so that all jobs are disjoint."""
        return self.passes_per_job

    def seed(self, number: int) -> int:
        """Return the seed of pass `number`."""
        return number


class _ScalarSeeds:
    """Seeds of scalar passes whose random numbers never overlap, in scrambled order."""

    scarce = True

    def __init__(self, variant: str, width: int, height: int) -> None:
        self.described = f"{variant} at {width}×{height}"
        blocks = -(-width // SCALAR_BLOCK) * -(-height // SCALAR_BLOCK)
        numbers_per_pass = blocks * SCALAR_BLOCK**2
        pixels = width * height
        #: Seeds between two neighbouring passes: the least that sets them a whole range apart.
        self.stride = -(-numbers_per_pass // pixels)
        #: How many passes fit below 2**32 without wrapping into the first.
        self.count = max(0, (2**32 - numbers_per_pass) // (self.stride * pixels) + 1)
        self.passes_per_job = self.count

    def reserved(self, needed: int) -> int:
        """Return the passes set aside for a job: no more than it needs, as there are few."""
        return needed

    def seed(self, number: int) -> int:
        """Return the seed of pass `number`, one of ``count``."""
        return self.stride * _scramble(number, self.count)


def _scramble(number: int, count: int) -> int:
    """Return the place of `number` in a fixed, irregular order of ``range(count)``.

    A four-round Feistel network is a bijection on a power of four; applying it again until the
    result falls below `count` makes it one on ``range(count)`` (Black and Rogaway 2002,
    "Ciphers with arbitrary finite domains", doi:10.1007/3-540-45760-7_9).
    """
    half = max(1, -(-(count - 1).bit_length() // 2))
    mask = (1 << half) - 1
    while True:
        left, right = number >> half, number & mask
        for key in (0x9E3779B9, 0x7F4A7C15, 0xF39CC060, 0x5CEDC834):
            left, right = right, left ^ (_mix(right ^ key) & mask)
        number = left << half | right
        if number < count:
            return number


def _mix(value: int) -> int:
    """Return a 32-bit hash of a 32-bit number (the finaliser of MurmurHash3, public domain)."""
    value = (value ^ value >> 16) * 0x85EBCA6B & 0xFFFFFFFF
    value = (value ^ value >> 13) * 0xC2B2AE35 & 0xFFFFFFFF
    return value ^ value >> 16
