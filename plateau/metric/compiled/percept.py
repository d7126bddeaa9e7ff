"""An image of the compiled predictor: its pixels, or everything computed from them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.compiled.levels import RING_ROWS, Side, across, rings
from plateau.metric.compiled.sweep import prepare
from plateau.metric.display import displayed, finite_pixels
from plateau.metric.pyramid import LEVELS

if TYPE_CHECKING:
    from plateau.metric.compiled.light import KernelView
    from plateau.metric.display import Image, Mask, Plane, View


class CompiledPercept:
    """A `Percept` that is prepared a few rows at a time during the comparison.

    It takes no memory beyond the image, which must not change while the percept is in use. `keep`
    computes everything at once, and so does access to the levels, the chroma or the map of pixels
    that are not finite. The levels have the bits of those of `VisibleDifferences`.
    """

    def __init__(self, view: View, image: Image, screen: KernelView) -> None:
        self.view = view  #: for which it is prepared
        self._screen = screen
        self._image: Image | None = image
        self._shape = image.shape[:2]
        self._kept: Side | None = None
        #: How many comparisons it has been in.
        self.comparisons = 0
        #: Whether it is kept and some pixels are not finite.
        self.has_non_finite = False

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self._shape
        return height, width

    @property
    def kept(self) -> bool:
        """Whether everything is computed and held."""
        return self._kept is not None

    @property
    def levels(self) -> Plane:
        """Luminance in cd/m² and its seven blurs, (8, H, W) float32."""
        levels: Plane = self.keep().planes[:LEVELS]
        return levels

    @property
    def chroma(self) -> Plane | None:
        """CIELAB a* and b*, (2, H, W) float32; None where luminance alone is judged."""
        return None if self.view.luminance_only else self.keep().planes[LEVELS:]

    @property
    def non_finite(self) -> Mask:
        """Which pixels have a channel that is NaN or infinite, (H, W); prepared as black."""
        return self.keep().non_finite

    def keep(self) -> Side:
        """Compute everything once, and drop the image."""
        if self._kept is None:
            height, _ = self.shape
            side = self._side(height)
            self.has_non_finite = prepare(side, self._screen) > 0
            self._kept = side._replace(
                image=_read_only(np.empty((0, 0), np.float32)), across=across(0)
            )
            self._image = None
            del self._pixels
        return self._kept

    def side(self) -> Side:
        """Return the input of the kernels: all planes if kept, else the image and low rings."""
        return self._kept or self._side(RING_ROWS)

    def _side(self, rows: int) -> Side:
        height, width = self.shape
        planes = rings(rows, width, chromatic=not self.view.luminance_only)
        return Side(self._pixels, planes, across(width), np.zeros((height, width), np.bool_))

    @cached_property
    def _pixels(self) -> Plane:
        """The image as (H, 3 W); with the view applied if that has a gamma."""
        assert self._image is not None
        image = self._image
        if self.view.gamma != 1:
            # `displayed` makes pixels that are not finite black or white.
            image = np.where(
                finite_pixels(image)[..., np.newaxis],
                displayed(image, self.view),
                np.float32("nan"),
            )
        height, width = self.shape
        return _read_only(np.ascontiguousarray(image).reshape(height, 3 * width))


def _read_only(plane: Plane) -> Plane:
    """Return a read-only view, so that every image has one type for the kernels."""
    plane = plane.view()
    plane.flags.writeable = False
    return plane
