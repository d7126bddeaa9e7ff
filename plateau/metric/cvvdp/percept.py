"""What a comparison needs of one image: its channels at each level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from plateau.metric.cvvdp.light import opponent
from plateau.metric.cvvdp.parameters import COLOURS
from plateau.metric.cvvdp.pyramid import band_frequencies, halved
from plateau.metric.display import as_image
from plateau.metric.rows import by_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.cvvdp.display import Display
    from plateau.metric.cvvdp.light import KernelDisplay
    from plateau.metric.display import Plane

#: The least height and width of an image, in pixels.
LEAST_SIZE = 4


@dataclass(frozen=True, eq=False)
class Percept:
    """One image, or one frame of a video, prepared for comparison on one display."""

    display: Display
    #: In cd/m², each level (channels, H, W) and half the size of the one before. A still has the
    #: opponent colours as channels, and a frame also the transient achromatic channel.
    levels: tuple[Plane, ...]
    #: Frames per second of the video; None for a still.
    fps: float | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        _, height, width = self.levels[0].shape
        return height, width


def checked(image: NDArray[Any], display: Display) -> NDArray[np.float32]:
    """Return the image as (H, W, 3) float32; raise ValueError if the display cannot show it."""
    image = as_image(image)
    height, width, _ = image.shape
    if min(height, width) < LEAST_SIZE:
        raise ValueError(f"an image of {width}×{height} pixels is too small: at least 4×4")
    if not np.isfinite(image).all():
        raise ValueError("an image for ColorVideoVDP has to be finite in every pixel")
    if display.transfer == "srgb":
        least, greatest = float(image.min()), float(image.max())
        if least < 0 or greatest > 1:
            raise ValueError(f"code values lie in [0, 1], not in [{least:g}, {greatest:g}]")
    return image


def write_colours(image: NDArray[np.float32], screen: KernelDisplay, out: Plane) -> None:
    """Write the opponent colours of a checked image on a screen into `out`, (3, H, W)."""
    height, width, _ = image.shape
    pixels = np.ascontiguousarray(image).reshape(height, COLOURS * width)
    by_rows(opponent, out.shape, pixels, screen, out)


def percept_of(channels: Plane, display: Display, fps: float | None = None) -> Percept:
    """Return the levels of the channels, (channels, H, W)."""
    _, height, width = channels.shape
    levels = [channels]
    for _ in band_frequencies((height, width), display.pixels_per_degree)[1:]:
        levels.append(halved(levels[-1]))
    return Percept(display, tuple(levels), fps)
