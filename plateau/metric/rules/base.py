"""The interface of a stopping rule: its verdicts and its memory.

A rule sees one evaluation at a time. It may keep earlier images and counts, all of them in its
`Memory`, so that a monitor that takes over a job reaches the same verdicts.

The modules of rules import numerics only inside the functions that judge. The command line, the API
and the page's form read the descriptions (`plateau.rules`) and must not wait for numerics.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from plateau.rules import StoppingRule

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from plateau.metric.display import Mask
    from plateau.metric.rules.evidence import Evidence

#: A value that json writes and reads back without loss.
Json: TypeAlias = "dict[str, Json] | list[Json] | str | int | float | bool | None"


@dataclass(frozen=True)
class Verdict:
    """A rule's judgement of the evidence."""

    #: Whether to stop rendering.
    stop: bool
    #: The number that the rule watches; None while it has none.
    value: float | None
    #: Every number behind the verdict, by name.
    numbers: dict[str, float | None]
    #: The verdict in plain words, numbers included.
    reason: str
    #: The rule stops when `value` falls to this; None if it stops for another reason.
    limit: float | None = None
    #: The map of visible pixels that was judged, (H, W) bool, if any.
    visible: Mask | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True, eq=False)
class Memory:
    """The state of a rule that must outlive its process."""

    #: Counts and the like.
    numbers: dict[str, Json] = field(default_factory=dict)
    #: Images by name, (H, W, 3) float32.
    images: dict[str, NDArray[np.float32]] = field(default_factory=dict)


@dataclass(kw_only=True)
class Rule(StoppingRule, ABC):
    """A stopping rule: a dataclass whose fields are its parameters, checked on construction.

    Each image that it keeps costs 12 bytes per pixel in memory and in every checkpoint. Only
    `reverse` also holds a percept, that of its first image, of 41 bytes per pixel of memory.
    """

    @abstractmethod
    def judge(self, evidence: Evidence) -> Verdict:
        """Return the verdict on this evidence, and remember what later verdicts need.

        Evaluations come in order of spp, with one image size and one view.

        Raises
        ------
        ValueError
            If the order or the size is violated.
        """

    def memory(self) -> Memory:
        """Return the state with which a fresh rule reaches the same later verdicts, if any."""
        return Memory()

    def recall(self, memory: Memory) -> None:
        """Restore the state of the rule that returned this memory.

        Raises
        ------
        ValueError
            If it is not the memory of such a rule.
        """
        if memory.numbers or memory.images:
            raise ValueError(f"not a memory of the rule {self.name!r}, which remembers nothing")


def points_in(rows: list[Json]) -> list[tuple[int, float]] | None:
    """Return the points in the rows of a memory; None where a row is none."""
    points = []
    for row in rows:
        match row:
            case [int(spp), int(count) | float(count)]:
                points.append((spp, count))
            case _:
                return None
    return points


def require_later(spp: int, newest: int | None) -> None:
    """Raise ValueError unless the evaluation comes after the newest one that the rule has seen."""
    if newest is not None and spp <= newest:
        raise ValueError(f"{spp} spp came after {newest} spp: the curve only goes on")
