"""Ways to spread the samples of a job over its image. Each returns the next round of a film."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bench.allocating.film import JUDGING, OTHERS, modelled, spread
from bench.experiment.other_rules import CYCLES_FACTOR, cycles_error, with_neighbours
from plateau.metric.allocation import plan_round
from plateau.metric.zone_noise import zone_sums

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.allocating.film import Film
    from plateau.metric import Evidence, Mask

#: Samples of a round of whole frames, and the least share that a round adds to a job.
STEP, LEAST = 100, 0.04


class Way(Protocol):
    """One way to allocate."""

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the pixels of the next round, and their samples.

        `seen` is the film as it is judged, and `flying` the samples of the round that is rendered.
        """


class Frames:
    """Whole frames."""

    def plan(self, film: Film, *_: Any) -> tuple[Mask, int]:
        """Return the next round."""
        return np.ones(film.spp.shape, np.bool_), film.whole(max(STEP, LEAST * film.mean_spp))


@dataclass
class Zones:
    """The farm's allocator."""

    size: int
    split: Any = field(default=OTHERS)  #: of the slices: the noise by which it decides

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the next round."""
        judged = seen if self.split is JUDGING else film.evidence(seen.metric, self.split)
        each = np.s_[:: self.size, :: self.size]
        plan = plan_round(
            seen.metric,
            *modelled(judged),
            target,
            spp=film.spp[each],
            planned=(film.spp + flying)[each],
            size=self.size,
        )
        return spread(plan.zones, self.size, film.spp), film.whole(plan.spp)


@dataclass
class Naive:
    """Zones that have too much to see get a quarter more, or a half if it is far too much."""

    size: int

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], target: float
    ) -> tuple[Mask, int]:
        """Return the next round."""
        estimate = modelled(seen)[2]
        share = zone_sums(estimate.visible, self.size) / self.size**2
        around = np.pad(share, 1, mode="edge")
        rows, columns = share.shape
        near = np.mean([around[y : y + rows, x : x + columns] for y, x in np.ndindex(3, 3)], axis=0)
        excess = np.maximum(share, near / 2) / target
        wanted = excess > (8 if (excess > 8).mean() > LEAST else 1)
        if not wanted.any():
            wanted = excess >= excess.max()
        pixels: Mask = spread(wanted, self.size, film.spp)
        growth = 0.5 if (excess[wanted] > 8).all() else 0.25
        return pixels, film.whole(growth * (film.spp + flying)[pixels].mean())


@dataclass
class Neyman:
    """Samples in proportion to the standard deviation of a zone's displayed noise."""

    size: int

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], *_: Any
    ) -> tuple[Mask, int]:
        """Return the next round."""
        model = modelled(seen)[0]
        energy = zone_sums(np.square(model.noise).sum(axis=-1) * film.spp, self.size)
        planned = film.spp + flying
        lack = np.sqrt(energy) / planned[:: self.size, :: self.size]
        pixels: Mask = spread(lack >= np.quantile(lack, 0.75), self.size, film.spp)
        return pixels, film.whole(0.25 * planned[pixels].mean())


@dataclass
class Cycles:
    """Pixels whose error is above Cycles' threshold, with their neighbours.

    The threshold is halved as often as the whole image still has more to see than the target.
    """

    threshold: float = 0.01

    def plan(
        self, film: Film, seen: Evidence, flying: NDArray[np.int64], *_: Any
    ) -> tuple[Mask, int]:
        """Return the next round."""
        assert seen.halves is not None
        error = cycles_error(seen.image, seen.halves[0].mean)
        while True:
            pixels = with_neighbours(error > CYCLES_FACTOR * self.threshold)
            if pixels.mean() > LEAST:
                return pixels, film.whole(0.25 * (film.spp + flying)[pixels].mean())
            self.threshold /= 2
