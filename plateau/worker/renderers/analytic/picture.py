"""What an analytic scene looks like: its converged image, and the film of any pass."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from plateau.farm.images.channels import Channels
from plateau.farm.model.aovs import AOVS
from plateau.worker.renderers.analytic import aovs as geometry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from plateau.farm.bundle.analytic import AnalyticScene

Array: TypeAlias = "NDArray[np.float64]"

#: A sample of heavy-tailed noise is a gamma variable of this shape: excess kurtosis 6/k = 120.
GAMMA_SHAPE: Final = 0.05
#: A firefly is this often a sample, and on average so many times as bright as white.
FIREFLY_PROBABILITY: Final = 3e-7
FIREFLY_BRIGHTNESS: Final = 200.0
#: Standard deviation of a Gaussian reconstruction filter, in pixels (Mitsuba's default).
FILTER_SIGMA: Final = 0.5


def _grey(width: int, height: int) -> Array:
    """A flat grey, which masks nothing."""
    return np.full((height, width, 3), 0.35)


def _ramp(width: int, height: int) -> Array:
    """Grey from dark to bright."""
    return np.repeat(np.linspace(0.1, 0.8, width)[None, :, None], height, axis=0).repeat(3, axis=2)


def _checks(width: int, height: int) -> Array:
    """Coloured gradients with edges."""
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    board = np.where((np.floor(9 * x) + np.floor(6 * y)) % 2 == 0, 0.8, 0.25)
    return np.stack([board * x, board * (1 - y), 0.5 * board], axis=-1)


def _texture(width: int, height: int) -> Array:
    """Grain, which masks by itself."""
    grain = np.random.default_rng(8).uniform(0.15, 0.55, (height, width, 1))
    return grain.repeat(3, axis=2)


#: What is seen, by the names of `plateau.farm.bundle.analytic.LIGHTS`.
LIGHTS: Final[Mapping[str, Callable[[int, int], Array]]] = {
    "grey": _grey,
    "ramp": _ramp,
    "checks": _checks,
    "texture": _texture,
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


#: Noise of the mean of so many samples, of mean 0 and variance 1/spp, by the names of
#: `plateau.farm.bundle.analytic.NOISES`.
NOISES: Final[Mapping[str, Callable[[np.random.Generator, tuple[int, ...], int], Array]]] = {
    "gaussian": _gaussian,
    "heavy-tailed": _heavy_tailed,
    "filtered": _filtered,
    "fireflies": _gaussian,
}


class Picture:
    """An analytic scene, ready to render: it takes memory from its first film on.

    Parameters
    ----------
    scene : AnalyticScene
        What is seen, and how noisy a sample is.
    aovs : sequence of str
        What the film has besides colour, of `plateau.worker.renderers.analytic.aovs.GEOMETRY`. They
        have no noise, but that the first sample of a pixel lies anywhere in it.
    """

    def __init__(self, scene: AnalyticScene, aovs: Sequence[str] = ()) -> None:
        self.scene = scene
        self._aovs = [
            (AOVS[name], values) for name, values in geometry.GEOMETRY.items() if name in aovs
        ]
        self.channels = Channels(
            (
                *("R", "G", "B", "W"),
                *("A" for _ in range(scene.alpha)),
                *(channel for aov, _ in self._aovs for channel in aov.channels),
            ),
            tuple(channel for aov, _ in self._aovs if aov.is_id for channel in aov.channels),
        )

    @cached_property
    def _light(self) -> Array:
        return LIGHTS[self.scene.light](self.scene.width, self.scene.height)

    @cached_property
    def _alpha(self) -> Array | None:
        return geometry.alpha(self.scene.width, self.scene.height) if self.scene.alpha else None

    @property
    def truth(self) -> NDArray[np.float32]:
        """The converged image, (height, width, 3) float32, premultiplied where it has alpha."""
        fireflies = FIREFLY_PROBABILITY * FIREFLY_BRIGHTNESS * self._has_fireflies
        return self._premultiplied(self._light + fireflies).astype(np.float32)

    def sum_of(self, rng: np.random.Generator, spp: int) -> Array:
        """Return the sum of so many samples of every pixel, (height, width, 3) float64.

        The sum is drawn at once, from the distribution that it has.
        """
        scene, light = self.scene, self._light
        noise = scene.level * NOISES[scene.noise](rng, light.shape, spp)
        total = spp * (light + noise) if scene.additive else spp * light * (1 + noise)
        if self._has_fireflies:
            hits = rng.poisson(FIREFLY_PROBABILITY * spp, light.shape[:2])
            total += (FIREFLY_BRIGHTNESS * rng.standard_gamma(hits))[..., None]
        return self._premultiplied(total)

    def film(self, spp: int, seed: int) -> NDArray[np.float32]:
        """Return the film of a pass, of `channels`: a pure function of its spp and seed.

        Philox takes the seed as its key, so that distinct seeds give independent samples.
        """
        rng = np.random.Generator(np.random.Philox(key=seed))
        scene = self.scene
        film = np.full((scene.height, scene.width, len(self.channels.names)), spp, np.float32)
        film[..., :3] = self.sum_of(rng, spp)
        if self._alpha is not None:
            film[..., 4] = spp * self._alpha
        if self._aovs:
            film[..., self.channels.judged :] = self._aov_sums(rng, spp)
        return film

    def _aov_sums(self, rng: np.random.Generator, spp: int) -> Array:
        """Return the sums of the AOVs, and the ids at the first sample of each pixel."""
        width, height = self.scene.width, self.scene.height
        x, y = geometry.pixel_centres(width, height)
        # Drawn after colour, which is the same with AOVs and without.
        first_x, first_y = rng.uniform(-0.5, 0.5, (2, height, width))
        planes = [
            values(x + first_x / width, y + first_y / height, self._light)
            if aov.is_id
            else spp * values(x, y, self._light)
            for aov, values in self._aovs
        ]
        return np.concatenate(planes, axis=-1)

    def _premultiplied(self, light: Array) -> Array:
        return light if self._alpha is None else light * self._alpha[..., None]

    @property
    def _has_fireflies(self) -> bool:
        return self.scene.noise == "fireflies"
