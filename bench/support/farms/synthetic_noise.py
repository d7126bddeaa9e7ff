"""Renders of which the truth is known, judged without a farm.

What a rule or an estimate makes of them can be held against what is true. The image and its noise
are those of the analytic renderer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.farm.bundle.analytic import AnalyticScene
from plateau.metric import Half
from plateau.worker.renderers.analytic.picture import Picture

if TYPE_CHECKING:
    from plateau.metric import Image

#: What tables call the noises of `plateau.farm.bundle.analytic.NOISES` that they name otherwise.
_NOISES = {"Gaussian": "gaussian", "with fireflies": "fireflies"}


@dataclass(frozen=True)
class Render:
    """One render that goes on for as long as it is asked to."""

    #: One of `plateau.farm.bundle.analytic.LIGHTS`.
    scene: str
    #: Gaussian, heavy-tailed, filtered, or with fireflies.
    noise: str
    #: Standard deviation of one sample over the scene's own light.
    level: float
    #: Pixels across and down.
    size: int
    seed: int

    @cached_property
    def picture(self) -> Picture:
        """The analytic scene that is rendered."""
        return Picture(
            AnalyticScene(
                width=self.size,
                height=self.size,
                light=self.scene,
                noise=_NOISES.get(self.noise, self.noise),
                level=self.level,
            )
        )

    @property
    def truth(self) -> Image:
        """The converged image, (size, size, 3) float32."""
        return self.picture.truth

    def images(self, spps: list[int]) -> Iterator[tuple[int, Image, tuple[Half, Half]]]:
        """Return the merged image and its two halves at each of these spp, 2 or more and ascending.

        Every image holds the samples of the one before. Where an odd number is added, the halves
        take turns at the sample more.
        """
        rng = np.random.default_rng([self.seed, self.size])
        sums = np.zeros((2, self.size, self.size, 3))
        counts = [0, 0]
        for spp in spps:
            for half, share in enumerate(((spp + 1) // 2, spp // 2)):
                sums[half] += self.picture.sum_of(rng, share - counts[half])
                counts[half] = share
            even, odd = (
                Half((total / count).astype(np.float32), count)
                for total, count in zip(sums, counts, strict=True)
            )
            yield spp, (sums.sum(axis=0) / spp).astype(np.float32), (even, odd)
