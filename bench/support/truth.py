"""How many pixels an allocation of samples leaves visible, by the noise of a whole recording.

Groups of recorded slices give independent samples of noise: their error against the mean of all,
scaled to each pixel's number of samples.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.metric import VisibleDifferences

Floats = NDArray[np.float64]
#: Groups of slices. The larger each is, the less its noise differs from that of a finished image.
GROUPS = 12


@dataclass(eq=False)
class Truth:
    """The noise of a scene, known from all of its slices."""

    metric: VisibleDifferences
    recording: NDArray[np.float32]  #: (slices, H, W, 3)
    slice_spp: int
    _errors: list[Floats] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        total = len(self.recording)
        group = total // GROUPS
        self._mean = self.recording.mean(axis=0, dtype=np.float64)
        self._percept = self.metric.percept(self.clean)
        for start in range(0, group * GROUPS, group):
            one = self.recording[start : start + group].mean(axis=0, dtype=np.float64)
            # The mean contains the group. To the noise of 1 spp:
            scale = math.sqrt(group * self.slice_spp / (1 - group / total))
            self._errors.append((one - self._mean) * scale)

    @property
    def clean(self) -> NDArray[np.float32]:
        """The mean of all slices, (H, W, 3)."""
        mean: NDArray[np.float32] = self._mean.astype(np.float32)
        return mean

    def image(self, group: int, spp: NDArray[Any] | float) -> NDArray[np.float32]:
        """Return an image with the noise of a group at this spp of each pixel, (H, W, 3)."""
        scale = np.sqrt(np.asarray(spp, np.float64))[..., np.newaxis]
        noisy = self._mean + self._errors[group] / scale
        image: NDArray[np.float32] = noisy.astype(np.float32)
        return image

    def visible(self, spp: NDArray[Any] | float) -> Floats:
        """Return the share of the groups in which each pixel is visible at its spp, (H, W)."""
        seen = np.zeros(self._mean.shape[:2])
        for number in range(GROUPS):
            percept = self.metric.percept(self.image(number, spp))
            seen += self.metric.compare(self._percept, percept).visible
        return seen / GROUPS

    def spp_at(self, allowed: float, spp: NDArray[Any] | float) -> float:
        """Return the mean spp at which samples spread like these leave `allowed` pixels visible."""
        factor = crossing(lambda one: float(self.visible(np.asarray(spp) * one).sum()), allowed)
        return float(np.mean(spp)) * factor


def crossing(falling: Callable[[float], float], value: float) -> float:
    """Return where a falling function of factors from 1e-3 to 1e6 reaches a value, to 1 %."""
    low, high = 1e-3, 1e6
    while high / low > 1.01:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if falling(middle) > value else (low, middle)
    return high
