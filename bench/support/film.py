"""A job's film whose pixels have numbers of samples of their own, replayed from recorded slices."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.metric import Estimate, Evidence, Half, Mask, Percept, VisibleDifferences
from plateau.metric.estimate import estimate_from
from plateau.metric.noise_model import NoiseModel, noise_model

#: Slices of a round: the image is judged by the even and the odd ones, and an allocation may be
#: decided by the first two against the last two.
ROUND = 4
JUDGING, OTHERS = ((0, 2), (1, 3)), ((0, 1), (2, 3))


@dataclass(eq=False)
class Film:
    """A film that has the first slices of a recording, other numbers of them at each pixel."""

    recording: NDArray[np.float32]  #: (slices, H, W, 3)
    slice_spp: int
    order: NDArray[np.intp]  #: of the slices
    exhausted: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._rounds = len(self.recording) // ROUND
        shape = self.recording.shape[1:]
        self._sums = np.zeros((ROUND, self._rounds + 1, *shape))
        for number, index in enumerate(self.order[: self._rounds * ROUND]):
            rounds, quarter = divmod(number, ROUND)
            np.add(
                self._sums[quarter, rounds],
                self.recording[index],
                out=self._sums[quarter, rounds + 1],
            )
        self._has: NDArray[np.intp] = np.zeros(shape[:2], np.intp)

    def clear(self) -> None:
        """Take all samples away."""
        self._has[:] = 0
        self.exhausted = False

    @property
    def spp(self) -> NDArray[np.int64]:
        """Samples per pixel, (H, W)."""
        return self._has * ROUND * self.slice_spp

    @property
    def mean_spp(self) -> float:
        """Their mean."""
        return float(self.spp.mean())

    def whole(self, spp: float) -> int:
        """Return these samples per pixel in whole rounds of slices, at least one."""
        each = ROUND * self.slice_spp
        return max(1, round(spp / each)) * each

    def add(self, pixels: Mask, spp: int) -> None:
        """Add samples to these pixels."""
        self._has[pixels] += spp // (ROUND * self.slice_spp)
        self.exhausted |= bool((self._has > self._rounds).any())
        np.minimum(self._has, self._rounds, out=self._has)

    def _quarters(self) -> list[NDArray[np.float64]]:
        height, width = self._has.shape
        rows, columns = np.arange(height)[:, np.newaxis], np.arange(width)
        return [self._sums[one][self._has, rows, columns] for one in range(ROUND)]

    def evidence(self, metric: VisibleDifferences, split: Any = JUDGING) -> Evidence:
        """Return the image and these halves."""
        quarters = self._quarters()
        even, odd = (
            (quarters[one] + quarters[other]) / (2 * self._has[..., np.newaxis])
            for one, other in split
        )
        spp = int(self.mean_spp) // 2 * 2
        image = ((even + odd) / 2).astype(np.float32)
        first, second = (Half(one.astype(np.float32), spp // 2) for one in (even, odd))
        return Evidence(spp, image, (first, second), metric)


def modelled(seen: Evidence) -> tuple[NoiseModel, Percept, Estimate]:
    """Return the noise model of an image, the percept of its clean image, and the estimate."""
    assert seen.halves is not None
    model = noise_model(seen.metric, seen.image, seen.halves)
    clean = seen.metric.percept(model.clean)
    return model, clean, estimate_from(seen.metric, model, clean)


def spread(zones: NDArray[Any], size: int, image: NDArray[Any]) -> NDArray[Any]:
    """Return a value of each zone as one of each pixel of an image."""
    height, width = image.shape[:2]
    return zones.repeat(size, axis=0).repeat(size, axis=1)[:height, :width]
