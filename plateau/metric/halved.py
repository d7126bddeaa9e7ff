"""An image and its halves, as they are and as a display shows them: what a blend is made of."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from plateau.metric.display import Image, Mask, Plane, View, as_image, finite_pixels
from plateau.metric.noise_model import Half

#: What makes another image of a finite (H, W, 3) float32 image of linear radiance, the same one
#: each time: a denoiser, or a view transform.
Change: TypeAlias = Callable[[Image], Image]


@dataclass(frozen=True, eq=False)
class Viewing:
    """The display on which errors count."""

    view: View
    see: Change

    def shown(self, image: Image) -> Image:
        """Return the image as seen, where light above white is white."""
        return np.clip(self.see(image), 0, np.float32(self.view.brightest))


@dataclass(frozen=True, eq=False)
class Halved:
    """A finite image and its halves, (H, W, 3) each."""

    image: Image
    one: Image
    other: Image
    share: float  #: of the samples in the first half
    screen: Viewing

    @cached_property
    def shown(self) -> tuple[Image, Image]:
        """The halves on the screen."""
        return self.screen.shown(self.one), self.screen.shown(self.other)

    @property
    def both(self) -> float:
        """The variance of the image, of the sum of its halves' variances."""
        return self.share * (1 - self.share)

    @property
    def apart(self) -> Plane:
        """The squared difference of the halves on the screen."""
        return energy(self.shown[0] - self.shown[1])

    def crossed(self, found: "Halved") -> Plane:
        """Return the squared differences of what was found of each half from the other half."""
        one, other = self.shown
        return energy(found.shown[0] - other) + energy(found.shown[1] - one)


def halved(image: Image, halves: tuple[Half, Half], screen: Viewing) -> tuple[Halved, Mask]:
    """Return the image and its halves without flaws, and where these were.

    Raises
    ------
    ValueError
        If the halves and the image differ in size.
    """
    one, other = halves
    flawed, (whole, *means) = _without_flaws(image, one.mean, other.mean)
    share = one.spp / (one.spp + other.spp)
    return Halved(whole, means[0], means[1], share, screen), flawed


def energy(image: Image) -> Plane:
    """Return the sum of the squares of a pixel's channels, (H, W)."""
    squares: Plane = np.square(image).sum(axis=-1)
    return squares


def _without_flaws(*images: NDArray[Any]) -> tuple[Mask, list[Image]]:
    """Return where an image is NaN or infinite, and the images with 0 there."""
    found = [as_image(image) for image in images]
    if len({image.shape for image in found}) > 1:
        raise ValueError("the image and its parts differ in size")
    flawed = ~np.logical_and.reduce([finite_pixels(image) for image in found])
    if flawed.any():
        found = [np.where(flawed[..., np.newaxis], np.float32(0), image) for image in found]
    return flawed, found
