"""A small image that is known: what a renderer has to make on every machine."""

import hashlib
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

#: How far the mean of a block may be from the truth: several times the noise of 64 spp.
_TOLERANCE: Final = 0.05
_BLOCK: Final = 8  #: pixels
_BITS_SHOWN: Final = 12

#: Of the known sphere, in units of the scene, and of R, G and B.
SPHERE_RADIUS: Final = 0.7
SPHERE_REFLECTANCE: Final = (0.2, 0.5, 0.8)


class CanaryWrong(Exception):
    """The image is far from the known one; the message says where."""


@dataclass(frozen=True, kw_only=True)
class Canary:
    """The film of one pass of a scene whose converged image is known.

    Attributes
    ----------
    film : ndarray, shape (height, width, channels), float32
        As `plateau.worker.renderers.contract.Renderer.render` yields it, under a box filter.
        Height and width are multiples of 8.
    truth : ndarray, shape (height, width, 3)
        The converged image.
    spp : int
        Samples per pixel of the film.
    """

    film: NDArray[np.float32]
    truth: NDArray[np.float64]
    spp: int

    @property
    def bits(self) -> str:
        """The beginning of the film's SHA-256: equal where machines render the same bits."""
        return hashlib.sha256(self.film.tobytes()).hexdigest()[:_BITS_SHOWN]

    def check(self) -> None:
        """Raise `CanaryWrong` where the film is not one of the known image."""
        if not (self.film[..., 3] == self.spp).all():
            raise CanaryWrong("a known image has other filter weights than it should")
        found, known = _blocks(self.film[..., :3]) / self.spp, _blocks(self.truth)
        wrong = ~(np.abs(found - known) < _TOLERANCE)  # NaN too
        if wrong.any():
            at = tuple(np.argwhere(wrong)[0])
            raise CanaryWrong(
                f"a known image is wrong in {wrong.any(axis=-1).mean():.0%} of its blocks: "
                f"{'RGB'[at[-1]]} is {found[at]:.3g} where {known[at]:.3g} is right"
            )


def known_sphere(size: int, weights: tuple[float, ...] | None = None) -> NDArray[np.float64]:
    """Return the converged image of a diffuse sphere in white light, (size, size, 3).

    A diffuse convex body under radiance 1 has its reflectance as radiance, and nothing lies behind
    it that is not 1. The view is orthographic, two units wide, and the sphere in its middle.

    Parameters
    ----------
    size : int
        Pixels of each side.
    weights : tuple of 3 float, optional
        Those of R, G and B in the luminance, for renderers that know nothing else.
    """
    parts = 16
    at = (np.arange(size * parts) + 0.5) / (size * parts) * 2 - 1
    inside = at[:, None] ** 2 + at**2 < SPHERE_RADIUS**2
    covered = inside.reshape(size, parts, size, parts).mean(axis=(1, 3))
    reflectance = np.asarray(SPHERE_REFLECTANCE)
    if weights is not None:
        reflectance = np.full(3, reflectance @ np.asarray(weights))
    known: NDArray[np.float64] = 1 - covered[..., None] * (1 - reflectance)
    return known


def _blocks(image: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the means of square blocks."""
    height, width, channels = image.shape
    blocks = image.reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, channels)
    means: NDArray[np.float64] = blocks.mean(axis=(1, 3), dtype=np.float64)
    return means
