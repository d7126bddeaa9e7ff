"""Renders whose truth is known, judged without a farm.

Rules and estimates can be compared with that truth. The image and its noise are those of the
analytic renderer.
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

#: The noises of `plateau.farm.bundle.analytic.NOISES` that have another name in tables.
_NOISES = {"Gaussian": "gaussian", "with fireflies": "fireflies"}


@dataclass(frozen=True)
class Render:
    """One render that can continue without end."""

    scene: str  #: one of `plateau.farm.bundle.analytic.LIGHTS`
    noise: str  #: Gaussian, heavy-tailed, filtered, or with fireflies
    level: float  #: standard deviation of one sample over the scene's own light
    size: int  #: pixels across and down
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
        """Yield the merged image and its two halves at each of these spp, ascending from 2 or more.

        Every image holds the samples of the one before. At odd spp the first half has one more.
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
