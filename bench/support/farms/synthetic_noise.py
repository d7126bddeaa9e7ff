"""Renders of which the truth is known: an image, and independent noise on every sample of it.

What a rule or an estimate makes of them can be held against what is true.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from plateau.metric import Half

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric import Image

Array: TypeAlias = "NDArray[np.float64]"

#: A sample of heavy-tailed noise is a gamma variable of this shape: excess kurtosis 6/k = 120.
GAMMA_SHAPE = 0.05
#: A firefly is this often a sample, and on average so many times as bright as white.
FIREFLY_PROBABILITY, FIREFLY_BRIGHTNESS = 3e-7, 200.0
#: Standard deviation of a Gaussian reconstruction filter, in pixels (Mitsuba's default).
FILTER_SIGMA = 0.5


def grey(size: int) -> Array:
    """A flat grey, which masks nothing."""
    return np.full((size, size, 3), 0.35)


def ramp(size: int) -> Array:
    """Grey from dark to bright."""
    return np.repeat(np.linspace(0.1, 0.8, size)[None, :, None], size, axis=0).repeat(3, axis=2)


def checks(size: int) -> Array:
    """Coloured gradients with edges."""
    y, x = np.mgrid[0 : 1 : size * 1j, 0 : 1 : size * 1j]
    board = np.where((np.floor(9 * x) + np.floor(6 * y)) % 2 == 0, 0.8, 0.25)
    return np.stack([board * x, board * (1 - y), 0.5 * board], axis=-1)


def texture(size: int) -> Array:
    """Grain, which masks by itself."""
    grain = np.random.default_rng(8).uniform(0.15, 0.55, (size, size, 1))
    return grain.repeat(3, axis=2)


#: What is seen, by name.
SCENES: dict[str, Callable[[int], Array]] = {
    "grey": grey,
    "ramp": ramp,
    "checks": checks,
    "texture": texture,
}


def _gaussian(rng: np.random.Generator, shape: tuple[int, ...], spp: int) -> Array:
    noise: Array = rng.standard_normal(shape) / np.sqrt(spp)
    return noise


def _heavy_tailed(rng: np.random.Generator, shape: tuple[int, ...], spp: int) -> Array:
    # A sum of gamma variables is one: exact, whatever the spp.
    mean = rng.gamma(GAMMA_SHAPE * spp, 1 / GAMMA_SHAPE, shape) / spp
    noise: Array = (mean - 1) * np.sqrt(GAMMA_SHAPE)
    return noise


def _filtered(rng: np.random.Generator, shape: tuple[int, ...], spp: int) -> Array:
    # Neighbours share their noise, as under a Gaussian reconstruction filter.
    taps = np.exp(-0.5 * (np.arange(-2, 3) / FILTER_SIGMA) ** 2)
    taps /= np.sqrt((taps**2).sum())
    noise = _gaussian(rng, shape, spp)
    for axis in (0, 1):
        noise = sum(tap * np.roll(noise, k - 2, axis) for k, tap in enumerate(taps))
    return noise


#: Noise of the mean of so many samples, of mean 0 and variance 1/spp, by name.
NOISES: dict[str, Callable[[np.random.Generator, tuple[int, ...], int], Array]] = {
    "Gaussian": _gaussian,
    "heavy-tailed": _heavy_tailed,
    "filtered": _filtered,
    "with fireflies": _gaussian,
}


@dataclass(frozen=True)
class Render:
    """One render that goes on for as long as it is asked to."""

    #: A key of `SCENES`.
    scene: str
    #: A key of `NOISES`.
    noise: str
    #: Standard deviation of one sample over the scene's own light.
    level: float
    #: Pixels across and down.
    size: int
    seed: int

    @property
    def truth(self) -> Image:
        """The converged image, (size, size, 3) float32."""
        light = SCENES[self.scene](self.size)
        if self.noise == "with fireflies":
            light = light + FIREFLY_PROBABILITY * FIREFLY_BRIGHTNESS
        return light.astype(np.float32)

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
                sums[half] += self._sum(rng, share - counts[half])
                counts[half] = share
            even, odd = (
                Half((total / count).astype(np.float32), count)
                for total, count in zip(sums, counts, strict=True)
            )
            yield spp, (sums.sum(axis=0) / spp).astype(np.float32), (even, odd)

    def film(self, index: int, spp: int) -> NDArray[np.float32]:
        """Return a slice's film before normalisation, (size, size, 4), by its index alone."""
        total = self._sum(np.random.default_rng([self.seed, self.size, index]), spp)
        weights = np.full((*total.shape[:2], 1), spp)
        return np.concatenate([total, weights], axis=-1).astype(np.float32)

    def _sum(self, rng: np.random.Generator, spp: int) -> Array:
        light = SCENES[self.scene](self.size)
        noise = NOISES[self.noise](rng, light.shape, spp)
        total = spp * light * (1 + self.level * noise)
        if self.noise == "with fireflies":
            hits = rng.poisson(FIREFLY_PROBABILITY * spp, light.shape[:2])
            total += (FIREFLY_BRIGHTNESS * rng.standard_gamma(hits))[..., None]
        return total
