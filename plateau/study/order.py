"""The order in which an observer sees the pairs of a study.

It is a pure function of the study and the observer. So it need not be stored, and a reloaded page
continues where it stopped.

*Method of constant stimuli*: two blocks, each with every level once. A block is a row of a Williams
square over the study's own shuffle of the levels. Over 2 L observers, each level is equally often
at each place of the first block, and follows each other level equally often. The second block is
another row and never begins with the last level of the first. Each level is shown once with the
reference at the left and once with it at the right; each block has the reference equally often at
either side (of an odd number, the sides get one more in turn).

*Method of limits*: all levels rising, then all falling; every other observer begins with the
falling ones. The sides are chosen in the same way.

References
----------
E. J. Williams, Experimental designs balanced for the estimation of residual effects of treatments,
Australian Journal of Scientific Research A 2, 1949. doi:10.1071/CH9490149
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeVar

Method = Literal["constant", "limits"]
Side = Literal["left", "right"]

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Pair:
    """The reference and a test image, which are shown together."""

    spp: int  #: of the test image
    reference: Side


def pairs(study_id: str, levels: tuple[int, ...], method: Method, number: int) -> tuple[Pair, ...]:
    """The pairs in the order in which an observer sees them, each level twice.

    `levels` are at least two, rising. The study's id seeds the shuffle; the observer's number, from
    0, counterbalances the order.
    """
    first, second = _blocks(study_id, levels, method, number)
    sides = _sides(study_id, levels, number)
    return (
        *(Pair(spp, sides[spp]) for spp in first),
        *(Pair(spp, _other(sides[spp])) for spp in second),
    )


def _blocks(
    study_id: str, levels: tuple[int, ...], method: Method, number: int
) -> tuple[list[int], list[int]]:
    if method == "limits":
        rising, falling = sorted(levels), sorted(levels, reverse=True)
        return (rising, falling) if number % 2 == 0 else (falling, rising)
    shuffled = _shuffled(levels, study_id)
    count = len(levels)
    first = _williams_row(count, number)
    # A later row, skipping any that begins with the last level of the first.
    ahead = 1 + number // (2 * count)
    while (second := _williams_row(count, number + ahead))[0] == first[-1]:
        ahead += 1
    return [shuffled[place] for place in first], [shuffled[place] for place in second]


def _williams_row(count: int, row: int) -> list[int]:
    """A row of the square: 0, 1, n-1, 2, n-2, …, shifted; reversed in every other square."""
    zigzag = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(count)]
    shifted = [(place + row) % count for place in zigzag]
    return shifted[::-1] if (row // count) % 2 else shifted


def _sides(study_id: str, levels: tuple[int, ...], number: int) -> dict[int, Side]:
    """The reference's side in the first block, by level."""
    half = (len(levels) + number % 2) // 2
    drawn = _shuffled(levels, f"{study_id}:{number}")
    return {spp: "left" if place < half else "right" for place, spp in enumerate(drawn)}


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"


def _shuffled(items: Iterable[_Item], seed: str) -> list[_Item]:
    """The items in an order that does not depend on the version of Python."""
    return sorted(items, key=lambda item: hashlib.sha256(f"{seed}:{item}".encode()).digest())
