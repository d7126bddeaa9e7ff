"""Fits a job's step, slices and cap to each other: steps and the cap are whole numbers of slices.

Seeds, halves and sums are by slices, all of one size. So the size of the slices gives way first,
then the step; the cap changes only where no slice of a useful size divides it, and then falls.
Slices that exist already keep their size, and then the cap rises; those that would be too small for
their inputs as well, and then the nearest cap is taken. By zones the plan has rounds that fill any
cap; a cap within the first rounds is one of whole films, and so of whole slices.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, TypeVar

from plateau.farm.model.spec.parts import LAG, ZonesAllocation
from plateau.farm.model.spec.shared import SharedSpec
from plateau.rules import MOST_SPP

_Spec = TypeVar("_Spec", bound=SharedSpec)

#: Slices may become larger or smaller than asked for by this factor.
_MOST_CHANGE: Final = 4
#: The cap may fall by this share before slices become larger or smaller instead.
_LITTLE: Final = 0.05
#: By zones, the slices of a step form halves in two ways.
_QUARTERS: Final = 4
#: Where the image is denoised, or a frame of a shot, they form halves.
_HALVES: Final = 2
_MOST_SLICE_SPP: Final = 4096

_NAMES: Final = ("step", "slice_spp", "max_spp")


def fitted(spec: _Spec, *, keep_slices: bool = False) -> _Spec:
    """The spec with a step and a cap of whole slices.

    Parameters
    ----------
    spec
        Any spec; one that fits is returned as it is.
    keep_slices
        Whether slices keep their size, as they exist already.

    Examples
    --------
    >>> from plateau.farm.model.spec import JobSpec
    >>> fit = fitted(JobSpec(max_spp=10))
    >>> fit.max_spp, fit.slice_spp, fit.step
    (10, 10, 100)
    >>> fit = fitted(JobSpec(max_spp=1001))
    >>> fit.max_spp, fit.slice_spp, fit.step
    (1001, 13, 104)
    >>> fit = fitted(JobSpec(max_spp=997))  # a prime
    >>> fit.max_spp, fit.slice_spp, fit.step
    (975, 25, 100)
    """
    least = _HALVES if spec.is_denoised or spec.shot is not None else 1
    whole = _Whole(
        of_step=_QUARTERS if spec.by_zones else least,
        of_cap=least,
        # `auto` may become frame.
        first_rounds=LAG if isinstance(spec.allocation, ZonesAllocation) else None,
    )
    asked = spec.step, spec.slice_spp, spec.max_spp
    step, size, cap = (whole.keeping if keep_slices else whole.fit)(*asked)
    if spec.inputs and size < spec.inputs[-1]:  # they are passes of the first slice
        step, size, _ = whole.keeping(*asked)
        cap = _nearest(spec.max_spp, size * least)
    changed = {"step": step, "slice_spp": size, "max_spp": cap}
    if spec.min_spp is not None:
        changed["min_spp"] = min(spec.min_spp, changed["max_spp"])
    different = {name: value for name, value in changed.items() if getattr(spec, name) != value}
    return spec.model_copy(update=different) if different else spec


def changes(asked: SharedSpec, fit: SharedSpec) -> tuple[str, ...]:
    """What `fitted` has changed of what was asked for, or of what it costs, as notes for people."""
    return tuple(
        f"{name} is {getattr(fit, name):,} in place of {getattr(asked, name):,}: steps and the cap "
        "are whole numbers of slices"
        for name in _NAMES
        if getattr(fit, name) != getattr(asked, name)
        and (name == "max_spp" or name in asked.model_fields_set)
    )


@dataclass(frozen=True)
class _Whole:
    """Of how many slices steps and the cap are multiples.

    By zones, caps above the steps of the first rounds are of any size.
    """

    of_step: int
    of_cap: int
    first_rounds: int | None

    def fit(self, step: int, size: int, cap: int) -> tuple[int, int, int]:
        """Step, slice and cap, of which the slice gives way first."""
        if self._fits(step, size, cap):
            return step, size, cap
        aim = max(1, min(size, step // self.of_step, cap // self.of_cap))
        for one in _near(aim):
            if self._fits(step, one, cap):
                return step, one, cap
        for one in _near(aim):
            if self._fits(fit := _nearest(step, one * self.of_step), one, cap):
                return fit, one, cap
        units = ((one, one * self.of_cap) for one in _near(aim))
        size = next((one for one, unit in units if cap % unit <= _LITTLE * cap), aim)
        unit = size * self.of_cap
        return _nearest(step, size * self.of_step), size, max(unit, cap - cap % unit)

    def keeping(self, step: int, size: int, cap: int) -> tuple[int, int, int]:
        """The same for slices that exist already: the cap rises."""
        step, unit = _nearest(step, size * self.of_step), size * self.of_cap
        if not self._fits(step, size, cap):
            cap = min(cap + -cap % unit, MOST_SPP - MOST_SPP % unit)
        return step, size, cap

    def _fits(self, step: int, size: int, cap: int) -> bool:
        any_cap = self.first_rounds is not None and cap > self.first_rounds * step
        return not step % (size * self.of_step) and (any_cap or not cap % (size * self.of_cap))


def _near(aim: int) -> Iterator[int]:
    """Sizes of slices by their distance from the one that is aimed at, up to `_MOST_CHANGE`."""
    low, high = -(-aim // _MOST_CHANGE), min(aim * _MOST_CHANGE, _MOST_SLICE_SPP)
    yield from sorted(range(low, high + 1), key=lambda size: max(size / aim, aim / size))


def _nearest(step: int, unit: int) -> int:
    """The multiple of the unit that is nearest to the step or cap, and allowed."""
    return max(1, min(round(step / unit), MOST_SPP // unit)) * unit
