"""An image as the compiled predictor holds it: as pixels, or as everything that depends on them."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.compiled.levels import RING_ROWS, Side, across, rings
from plateau.metric.compiled.sweep import prepare
from plateau.metric.display import displayed, finite_pixels
from plateau.metric.pyramid import LEVELS

if TYPE_CHECKING:
    from plateau.metric.compiled.light import Screen
    from plateau.metric.display import Image, Mask, Plane, View


class CompiledPercept:
    """A `Percept` whose image is prepared a few rows at a time as it is compared.

    So it takes no memory beyond the image, which must not change while this is in use. `keep` works
    everything out once and for all; so does asking for the levels, the chroma or the map of pixels
    that are not finite. The levels have the same bits as those of `VisibleDifferences`.
    """

    def __init__(self, view: View, image: Image, screen: Screen) -> None:
        self._view = view
        self._screen = screen
        self._image: Image | None = image
        self._shape = image.shape[:2]
        self._kept: Side | None = None
        #: How often it was compared.
        self.comparisons = 0
        #: Whether it is kept and has pixels that are not finite.
        self.has_non_finite = False

    @property
    def view(self) -> View:
        """The view for which it is prepared."""
        return self._view

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        height, width = self._shape
        return height, width

    @property
    def kept(self) -> bool:
        """Whether everything is worked out and held."""
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
        """Work everything out, if that was not done before, and let go of the image."""
        if self._kept is None:
            height, _ = self.shape
            side = self._side(height)
            self.has_non_finite = prepare(side, self._screen) > 0
            # Nothing will be made from the image again.
            self._kept = side._replace(
                image=_read_only(np.empty((0, 0), np.float32)), across=across(0)
            )
            self._image = None
            del self._pixels
        return self._kept

    def side(self) -> Side:
        """Return what the kernels compare: everything if it is kept, else what makes it."""
        return self._kept or self._side(RING_ROWS)

    def _side(self, rows: int) -> Side:
        height, width = self.shape
        planes = rings(rows, width, chromatic=not self.view.luminance_only)
        return Side(self._pixels, planes, across(width), np.zeros((height, width), np.bool_))

    @cached_property
    def _pixels(self) -> Plane:
        """The image as (H, 3 W); as it is shown where the view has a gamma, else as it came."""
        assert self._image is not None
        image = self._image
        if self.view.gamma != 1:
            # Only what is not finite must not be taken for black or white.
            image = np.where(
                finite_pixels(image)[..., np.newaxis],
                displayed(image, self.view),
                np.float32("nan"),
            )
        height, width = self.shape
        return _read_only(np.ascontiguousarray(image).reshape(height, 3 * width))


def _read_only(plane: Plane) -> Plane:
    """Return a view that cannot be written through: one type for the kernels, whatever comes."""
    plane = plane.view()
    plane.flags.writeable = False
    return plane
