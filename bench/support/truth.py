"""How many pixels an allocation of samples leaves visible, by the noise of a whole recording.

Groups of recorded slices give independent samples of noise: their error against the mean of all,
scaled to each pixel's number of samples.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.metric import VisibleDifferences
from plateau.metric.zone_noise import zone_sums

Floats = NDArray[np.float64]
#: Groups of slices. The larger each is, the less its noise differs from that of a finished image.
GROUPS = 12
#: The samples at which the oracle knows each zone, as factors of those of whole frames.
_FACTORS = np.geomspace(1 / 32, 8, 28)


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

    def visible(self, spp: NDArray[Any] | float, groups: Sequence[int] | None = None) -> Floats:
        """Return the share of the groups in which each pixel is visible at its spp, (H, W)."""
        chosen = range(GROUPS) if groups is None else groups
        seen = np.zeros(self._mean.shape[:2])
        for number in chosen:
            percept = self.metric.percept(self.image(number, spp))
            seen += self.metric.compare(self._percept, percept).visible
        seen /= len(chosen)
        return seen

    def spp_at(
        self, allowed: float, spp: NDArray[Any] | float, groups: Sequence[int] | None = None
    ) -> float:
        """Return the mean spp at which samples spread like these leave `allowed` pixels visible."""
        factor = crossing(
            lambda factor: float(self.visible(np.asarray(spp) * factor, groups).sum()), allowed
        )
        return float(np.mean(spp)) * factor

    def oracle(self, allowed: float, size: int) -> float:
        """Return the mean spp of who knows the noise of each zone from half of the groups."""
        known, others = list(range(0, GROUPS, 2)), list(range(1, GROUPS, 2))
        spp = self.spp_at(allowed, 1000.0, known) * _FACTORS
        counts = np.stack([zone_sums(self.visible(one, known), size) for one in spp], axis=-1)

        def cheapest(price: float) -> Floats:
            best: Floats = spp[(spp * size**2 + price * counts).argmin(axis=-1)]
            return best

        def left(price: float) -> float:
            place = (spp * size**2 + price * counts).argmin(axis=-1)[..., np.newaxis]
            return float(np.take_along_axis(counts, place, -1).sum())

        best = cheapest(1000 * crossing(lambda price: left(1000 * price), allowed))
        height, width = self._mean.shape[:2]
        pixels = best.repeat(size, axis=0).repeat(size, axis=1)[:height, :width]
        return self.spp_at(allowed, pixels, others)


def crossing(falling: Callable[[float], float], value: float) -> float:
    """Return where a falling function of factors from 1e-3 to 1e6 reaches a value, to 1 %."""
    low, high = 1e-3, 1e6
    while high / low > 1.01:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if falling(middle) > value else (low, middle)
    return high
