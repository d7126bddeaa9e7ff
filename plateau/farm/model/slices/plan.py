"""What each slice of a job has: which zones of the film, and how many samples.

The slices between two points of the curve are a *round*: they have the same zones and the same spp.
Where a job allocates its samples by frame, each round is a step. Where it does so by zones, its
first rounds are steps of whole films, and the image after each round decides the round after the
next, and how many slices that has. No worker waits for a judgement; merged slices decide the plan.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from plateau.farm.model.passes import MOST_SLICE_SPP
from plateau.farm.model.slices.looks import Looks
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.slices.zones import Grid, pixels_of
from plateau.farm.model.spec import SharedSpec
from plateau.farm.model.spec.parts import LAG, ZonesAllocation

#: Those of `auto`: until it is decided, no more is planned than both ways begin with.
_ZONES: Final = ZonesAllocation()


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The slices of a job, as far as they are decided.

    Attributes
    ----------
    slice_spp, step_slices, max_spp : int
        Of the job: spp of a slice of the whole film, such slices of a step, and the cap in spp.
    width, height : int or None
        Of the film, in pixels; None before it is known.
    size : int or None
        Of a zone, in pixels; None where the job is allocated by frame.
    looks : Looks or None
        The points of the curve where whole films are denoised; None where they are not.
    decided : tuple of Round
        The rounds that an image has decided, from round `LAG` on.
    """

    slice_spp: int
    step_slices: int
    max_spp: int
    width: int | None = None
    height: int | None = None
    size: int | None = None
    looks: Looks | None = None
    decided: tuple[Round, ...] = ()

    @classmethod
    def of(
        cls,
        spec: SharedSpec,
        width: int | None = None,
        height: int | None = None,
        decided: Iterable[Round] = (),
        looks: Sequence[tuple[int, int | None]] = (),
    ) -> "Plan":
        """Return the plan of a job of this spec, with a film of this size in pixels if known.

        `looks` are the points of a denoised image: their spp, and where they expect the job to end.
        """
        zones = spec.allocation if isinstance(spec.allocation, ZonesAllocation) else _ZONES
        size = zones.size if spec.by_zones else None
        whole = spec.max_spp - spec.max_spp % spec.slice_spp
        return cls(
            slice_spp=spec.slice_spp,
            step_slices=spec.step // spec.slice_spp,
            max_spp=spec.max_spp,
            width=width,
            height=height,
            size=size,
            looks=Looks.after(looks, spec.step, whole) if spec.is_denoised and not size else None,
            decided=() if size is None else tuple(decided),
        )

    @property
    def by_zones(self) -> bool:
        """Whether the job is allocated by zones."""
        return self.size is not None

    @property
    def grid(self) -> Grid:
        """The zones of the film.

        Raises
        ------
        ValueError
            The job is allocated by frame, or its film is not known yet.
        """
        if self.width is None or self.height is None or self.size is None:
            raise ValueError("a film of unknown size has no zones")
        return Grid(self.width, self.height, self.size)

    @property
    def pixels(self) -> int:
        """Of the film; 0 before it is known."""
        return (self.width or 0) * (self.height or 0)

    def slice_round(self, index: int) -> Round | None:
        """Return the round of slice `index` if an image has decided it."""
        number = bisect_right(self._ends, index) - LAG
        return self.decided[number] if self.by_zones and number >= 0 else None

    def slice_spp_of(self, index: int) -> int:
        """Return the samples per pixel of slice `index`."""
        one = self.slice_round(index)
        return self.slice_spp if one is None else one.spp

    @property
    def stop(self) -> int:
        """The number of slices that are decided."""
        return self._ends[-1] if self.by_zones else self._most

    @cached_property
    def _ends(self) -> tuple[int, ...]:
        """By zones, the number of slices at the end of each round."""
        first = (min(self._most, number * self.step_slices) for number in range(1, LAG + 1))
        return (*first, *(one.stop for one in self.decided if one.slices))

    @property
    def is_complete(self) -> bool:
        """Whether the cap leaves no room for more slices than those that are decided."""
        if not self.by_zones or self.max_spp <= LAG * self.step_slices * self.slice_spp:
            return True
        return any(not one.slices for one in self.decided)

    @property
    def _most(self) -> int:
        """The number of slices at the cap, if all are whole films."""
        return self.max_spp // self.slice_spp

    def rounds(self, slices: int) -> int:
        """Return how many rounds by zones the first slices complete."""
        return bisect_right(self._ends, slices)

    def end_of_rounds(self, slices: int) -> int:
        """Return how many of the first slices are rounds by zones that they complete."""
        rounds = self.rounds(slices)
        return self._ends[rounds - 1] if rounds else 0

    def decides(self, slices: int) -> bool:
        """Whether the image of so many slices, the end of a round, has a round to decide."""
        if not self.by_zones or self.is_complete:
            return False
        return slices == self._ends[len(self.decided)]

    def is_point(self, slices: int) -> bool:
        """Whether the image of so many slices is judged."""
        if not slices:
            return False
        if self.looks is not None:
            return self.spp(slices) in self.looks
        if self.by_zones:
            return slices in self._ends
        return not slices % self.step_slices or slices == self.stop

    def samples(self, slices: int) -> int:
        """Return the samples of the first slices, over all pixels of the film."""
        whole = min(slices, LAG * self.step_slices) if self.by_zones else slices
        samples = whole * self.slice_spp * self.pixels
        for one in self.decided:
            samples += max(0, min(slices - one.first, one.slices)) * one.spp * one.pixels
        return samples

    def spp(self, slices: int) -> int:
        """Return the samples per pixel of the first slices: by zones their mean, rounded down."""
        if not self.by_zones or slices <= LAG * self.step_slices:
            return slices * self.slice_spp
        return self.samples(slices) // self.pixels

    def slices_of(self, spp: int) -> int:
        """Return the first slices that have these samples per pixel, or else almost as many.

        By zones, several numbers of slices may have the same. One that is judged comes first.
        """
        if not self.by_zones:
            return spp // self.slice_spp
        every = range(self.stop + 1)
        last = bisect_right(every, spp, key=self.spp) - 1
        first = bisect_left(every, self.spp(last), key=self.spp)
        return next(filter(self.is_point, range(first, last + 1)), first)

    def point_from(self, spp: int) -> int:
        """Return the slices of the first point of the curve that has so many samples per pixel.

        Where no such point is decided, these are the slices that are.
        """
        look = None if self.looks is None else self.looks.first_from(spp)
        if look is not None:
            return look // self.slice_spp
        if not self.by_zones:
            return -(-spp // (self.step_slices * self.slice_spp)) * self.step_slices
        return next((end for end in self._ends if self.spp(end) >= spp), self.stop)

    def round_of(self, zones: Iterable[int] | None, spp: int, slice_spp: int) -> Round:
        """Return the next round: as many samples as are asked for, or as the cap leaves.

        Where the cap leaves less than a sample for each pixel of the film, the plan ends.

        Parameters
        ----------
        zones
            Numbers of its zones; None for all.
        spp
            Samples per pixel in all; rounded up to a multiple of the number of slices.
        slice_spp
            The most of one slice, at least 1.
        """
        numbers = None if zones is None else tuple(sorted(zones))
        pixels = self.pixels if numbers is None else pixels_of(self.grid.zones(numbers))
        left = (self.max_spp * self.pixels - self.samples(self.stop)) // pixels
        fours = -(-spp // (4 * min(slice_spp, MOST_SLICE_SPP)))
        each = -(-spp // (4 * fours))
        if 4 * fours * each > left:
            fours = max(1, left // (4 * each))
            each = min(each, left // (4 * fours))
        one = Round(self.stop, 4 * fours, each, numbers, pixels)
        return one if one.samples >= self.pixels else replace(one, slices=0, spp=0)

    def with_point(self, slices: int, expected_spp: int | None) -> "Plan":
        """Return the plan after a point of the curve: it decides the look after it.

        `expected_spp` is where the image of these slices expects the job to end, if it does.
        """
        if self.looks is None:
            return self
        return replace(self, looks=self.looks.with_look(self.spp(slices), expected_spp))

    def with_round(self, one: Round) -> "Plan":
        """Return the plan with one round more."""
        return replace(self, decided=(*self.decided, one))
