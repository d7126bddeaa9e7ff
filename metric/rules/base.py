"""What every stopping rule answers, and what it keeps.

A rule is told the story one evaluation at a time. It may keep earlier images and counts; all that
it keeps is in its `Memory`, so that a monitor that takes over a job goes on to the same verdicts.

The files of rules import numerics only where they judge: the command line, the API and the page's
form read what they say of themselves (`plateau.rules`), and wait for no more.
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

#: What json can write and read back without loss.
Json: TypeAlias = "dict[str, Json] | list[Json] | str | int | float | bool | None"


@dataclass(frozen=True)
class Verdict:
    """What a rule makes of the evidence."""

    #: Whether to stop rendering.
    stop: bool
    #: The number that the rule watches; None where it has none yet.
    value: float | None
    #: Every number behind the verdict, by name.
    numbers: dict[str, float | None]
    #: The verdict in plain words, numbers included.
    reason: str
    #: What `value` must come down to; None where the rule waits for something else.
    limit: float | None = None
    #: The map of visible pixels that was judged, (H, W) bool, where there is one.
    visible: Mask | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True, eq=False)
class Memory:
    """What of a rule must outlive its process, and nothing more."""

    #: Counts and the like; `json` writes and reads it without loss.
    numbers: dict[str, Json] = field(default_factory=dict)
    #: Images by name, (H, W, 3) float32.
    images: dict[str, NDArray[np.float32]] = field(default_factory=dict)


@dataclass(kw_only=True)
class Rule(StoppingRule, ABC):
    """A stopping rule: a dataclass whose fields are its parameters, checked on construction."""

    @abstractmethod
    def judge(self, evidence: Evidence) -> Verdict:
        """Return the verdict on this evidence, and remember what later ones need.

        Evaluations come in order of spp, one image size and one view throughout.

        Raises
        ------
        ValueError
            If they do not.
        """

    @abstractmethod
    def stored_images(self, evaluations: int) -> int:
        """Return how many images the rule keeps after so many evaluations at equal steps.

        That is what it costs in memory and in every checkpoint: 12 bytes a pixel for each. The one
        percept that any rule holds, of the first image in `reverse`, adds 41 to the memory alone.
        """

    @abstractmethod
    def memory(self) -> Memory:
        """Return what the rule must keep: recalled by a fresh rule, later verdicts are the same."""

    @abstractmethod
    def recall(self, memory: Memory) -> None:
        """Take up where the rule that gave this memory left off.

        Raises
        ------
        ValueError
            If it is not the memory of such a rule.
        """


def require_later(spp: int, newest: int | None) -> None:
    """Raise ValueError unless the evaluation comes after the newest one that the rule has seen."""
    if newest is not None and spp <= newest:
        raise ValueError(f"{spp} spp came after {newest} spp: the curve only goes on")
