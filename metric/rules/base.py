"""What every stopping rule is given, what it answers, and what it keeps.

A rule is told the story one evaluation at a time. It may keep earlier images and counts; all that
it keeps is in its `Memory`, so that a monitor that takes over a job goes on to the same verdicts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, TypeAlias

from plateau.metric.bounds import require_bounds
from plateau.metric.display import as_image, finite_pixels
from plateau.metric.estimate import Estimate, estimate_from
from plateau.metric.forecasts import Forecast, forecast_from
from plateau.metric.noise_model import Half, NoiseModel, noise_model

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from plateau.metric.display import Image, Mask
    from plateau.metric.vdp import Percept, VisibleDifferences

#: What json can write and read back without loss.
Json: TypeAlias = "dict[str, Json] | list[Json] | str | int | float | bool | None"

#: The paper's image size, for which thresholds and slopes in pixels are taken to hold.
PAPER_PIXELS = 512 * 512

#: The most samples per pixel that anybody can ask for.
MOST_SPP = 1_000_000


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known at one evaluation. Work that several rules need is done once, when asked for.

    Raises
    ------
    ValueError
        If there is no sample, or the halves do not add up to the whole.
    """

    #: Samples per pixel in the merged image.
    spp: int
    #: The merged image: (H, W, 3) float32 linear radiance.
    image: Image
    #: The even- and the odd-indexed slices apart; None while there are not two of them.
    halves: tuple[Half, Half] | None
    #: The predictor, under the view in which to judge.
    metric: VisibleDifferences

    def __post_init__(self) -> None:
        if self.spp < 1:
            raise ValueError(f"an evaluation needs at least 1 spp, not {self.spp}")
        if self.halves is not None and sum(half.spp for half in self.halves) != self.spp:
            even, odd = self.halves
            raise ValueError(f"halves of {even.spp} and {odd.spp} spp do not make {self.spp} spp")

    @property
    def pixels(self) -> int:
        """How many pixels the image has."""
        height, width = self.percept.shape
        return height * width

    @cached_property
    def finite(self) -> Mask:
        """Which pixels of the merged image are neither NaN nor infinite, (H, W) bool."""
        return finite_pixels(as_image(self.image))

    @cached_property
    def percept(self) -> Percept:
        """The merged image, prepared for comparison."""
        return self.metric.percept(self.image)

    @cached_property
    def _model(self) -> tuple[NoiseModel, Percept] | None:
        """The merged image taken apart, and the percept of what is left without its noise."""
        if self.halves is None:
            return None
        model = noise_model(self.metric, self.image, self.halves)
        return model, self.metric.percept(model.clean)

    @cached_property
    def estimate(self) -> Estimate | None:
        """The half-buffer estimate; None where there are no halves."""
        return None if self._model is None else estimate_from(self.metric, *self._model)

    @cached_property
    def kept_image(self) -> Image:
        """A copy of the merged image for rules to keep, one for all of them; it cannot be changed.

        A copy, for the monitor may go on adding to its own.
        """
        image: Image = as_image(self.image).copy()
        image.flags.writeable = False
        return image

    def forecast(self, target: float, *, guess: int | None = None) -> Forecast | None:
        """Return where the estimate will fall to this share of the pixels; None without halves.

        `guess` is the spp of an earlier forecast for this target, which saves work.
        """
        if self._model is None or self.estimate is None:
            return None
        return forecast_from(
            self.metric, *self._model, self.estimate, target, spp=self.spp, guess=guess
        )


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
class Rule(ABC):
    """A stopping rule: a dataclass whose fields are its parameters, checked on construction."""

    #: How a job names the rule.
    name: ClassVar[str]

    def __post_init__(self) -> None:
        require_bounds(self)

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
