"""Yee's fast visible-differences predictor: which pixels of two images differ visibly.

`VisibleDifferences.percept` computes everything that depends on one image only, so that a job
prepares its reference once. `VisibleDifferences.compare` compares two percepts.

References
----------
H. Yee, A perceptual metric for production testing, journal of graphics tools 9(4), 2004.
doi:10.1080/10867651.2004.10504900
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from plateau.metric.csf import (
    PEAK_FREQUENCY_CPD,
    PEAK_LUMINANCE,
    contrast_sensitivity,
    luminance_threshold,
    masking,
)
from plateau.metric.denoise import denoised
from plateau.metric.display import (
    Image,
    Mask,
    Plane,
    View,
    as_image,
    displayed,
    finite_pixels,
    opponent_chroma,
    require_same_size,
    tristimulus,
)
from plateau.metric.pyramid import LEVELS, blurred_levels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Indices: TypeAlias = NDArray[np.intp]

#: Contrast bands: each needs its own level and the two after it.
BANDS = LEVELS - 2
#: Luminances and contrasts are divided by at least this (cd/m² and 1).
FLOOR = 1e-5
#: The greatest weight of a band: its product with any contrast stays within float32.
MOST_WEIGHT = 1e30
#: The range of the threshold elevation.
ELEVATION_MIN, ELEVATION_MAX = 1.0, 10.0
#: Below this adaptation luminance, in cd/m², colour is not judged.
COLOUR_LUMINANCE = 10.0

#: Pixels of one step of the elevation: few enough to stay in a core's cache.
_BLOCK = 8192


class Percept(Protocol):
    """One image, prepared for comparison under one view."""

    @property
    def view(self) -> View:
        """The view for which it is prepared."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""

    @property
    def levels(self) -> Plane:
        """Luminance in cd/m² and its seven blurs, (8, H, W) float32."""

    @property
    def chroma(self) -> Plane | None:
        """CIELAB a* and b*, (2, H, W) float32; None where luminance alone is judged."""

    @property
    def non_finite(self) -> Mask:
        """Which pixels have a channel that is NaN or infinite, (H, W); prepared as black."""


@dataclass(frozen=True, eq=False)
class PreparedPercept:
    """A `Percept` with everything computed at its construction."""

    view: View
    levels: Plane
    chroma: Plane | None
    non_finite: Mask

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        _, height, width = self.levels.shape
        return height, width


@dataclass(frozen=True, eq=False)
class Difference:
    """Where a test image differs visibly from a reference."""

    #: The map of visible pixels, (H, W) bool; non-finite pixels are among them.
    visible: Mask
    #: How many pixels are visible: the "VDP difference".
    count: int
    #: `count` over the number of pixels, in [0, 1].
    fraction: float
    #: How many pixels are not finite in either image.
    non_finite: int

    @property
    def finite_count(self) -> int:
        """How many visible pixels are finite in both images: more samples change no others."""
        return self.count - self.non_finite


class VisibleDifferences:
    """The predictor under one view.

    This class is plain numpy, and the reference for `plateau.metric.compiled`, which is faster for
    many images and loads a compiler once.

    Examples
    --------
    >>> metric = VisibleDifferences(View())
    >>> grey = np.full((64, 64, 3), 0.5, np.float32)
    >>> spot = grey.copy()
    >>> spot[30:34, 30:34] = 1.0
    >>> metric.compare(metric.percept(grey), metric.percept(spot)).count
    16
    """

    def __init__(self, view: View) -> None:
        self.view = view

    @staticmethod
    def denoised(image: Image, noise: Image) -> Image:
        """Return `plateau.metric.denoise.denoised`; a faster predictor overrides it."""
        return denoised(image, noise)

    def percept(self, image: NDArray[Any]) -> Percept:
        """Return everything that depends on this image only.

        Parameters
        ----------
        image
            (H, W, 3), of any real dtype; linear radiance unless the view has a gamma.

        Raises
        ------
        ValueError
            If the image is not (H, W, 3).
        """
        image = as_image(image)
        non_finite = ~finite_pixels(image)
        if non_finite.any():
            # The blurs would spread a NaN over their whole reach.
            image = np.where(non_finite[..., np.newaxis], np.float32(0), image)
        view = self.view
        xyz = tristimulus(displayed(image, view), view.primaries)
        levels = blurred_levels(np.float32(view.white_luminance) * xyz[1])
        chroma = None if view.luminance_only else opponent_chroma(xyz, view.primaries)
        return PreparedPercept(view, levels, chroma, non_finite)

    def compare(self, reference: Percept, test: Percept) -> Difference:
        """Return where the test image differs visibly from the reference.

        The comparison is symmetric.

        Raises
        ------
        ValueError
            If the images differ in size, or were prepared under another view.
        """
        self.check(reference, test)

        # Thresholds without masking, from the luminance to which the eye is adapted.
        level = self.adaptation_level(reference.shape[1])
        adaptation = reference.levels[level] + test.levels[level]
        adaptation *= 0.5
        np.maximum(adaptation, FLOOR, out=adaptation)
        threshold = luminance_threshold(adaptation)

        # A difference, in units of its unelevated threshold, is visible above F.
        excess = np.abs(reference.levels[0] - test.levels[0])
        colour = _colour_difference(reference, test, adaptation)

        # F lies between two constants, which decide most pixels; only the others need F itself.
        visible = _exceeds(excess, threshold, colour, ELEVATION_MAX)
        undecided = _exceeds(excess, threshold, colour, ELEVATION_MIN)
        undecided &= ~visible
        indices = np.flatnonzero(undecided)
        for start in range(0, indices.size, _BLOCK):
            block = indices[start : start + _BLOCK]
            elevation = self._elevation(reference, test, adaptation.ravel()[block], block)
            visible.ravel()[block] = _exceeds(
                excess.ravel()[block],
                threshold.ravel()[block],
                None if colour is None else colour.ravel()[block],
                elevation,
            )

        non_finite = reference.non_finite | test.non_finite
        visible |= non_finite
        count = int(np.count_nonzero(visible))
        return Difference(visible, count, count / visible.size, int(np.count_nonzero(non_finite)))

    def check(self, reference: Percept, test: Percept) -> None:
        """Raise ValueError unless both have one size and this view."""
        require_same_size(reference.shape, test.shape)
        for percept in (reference, test):
            if percept.view != self.view:
                raise ValueError(f"an image prepared for {percept.view} met {self.view}")

    def _elevation(
        self, reference: Percept, test: Percept, adaptation: Plane, indices: Indices
    ) -> Plane:
        """Return the threshold elevation F of some pixels, given by flat index."""
        ours = reference.levels.reshape(LEVELS, -1)[:, indices]
        theirs = test.levels.reshape(LEVELS, -1)[:, indices]

        # Contrast in each band: the detail that one blur removes, over the luminance around it.
        contrast = np.maximum(
            np.abs(ours[:BANDS] - ours[1:-1]), np.abs(theirs[:BANDS] - theirs[1:-1])
        )
        contrast /= np.maximum(np.maximum(ours[2:], theirs[2:]), FLOOR)

        # Masking of each band, weighted by its contrast and the eye's sensitivity.
        width = reference.shape[1]
        frequencies = self.frequencies_cpd(width)[:, np.newaxis]
        masked = masking(contrast * contrast_sensitivity(frequencies, adaptation))
        masked *= self.band_weights(width)[:, np.newaxis]
        masked *= contrast
        total = np.maximum(contrast.sum(axis=0), FLOOR)
        elevation: Plane = np.clip(masked.sum(axis=0) / total, ELEVATION_MIN, ELEVATION_MAX)
        return elevation

    def adaptation_level(self, width: int) -> int:
        """Return the level with the luminance to which the eye adapts: blurred by about one degree.

        `width` is that of the image, in pixels.
        """
        degrees = self.view.width_deg(width)
        return next((level for level in range(LEVELS) if 2**level > degrees), LEVELS - 1)

    def frequencies_cpd(self, width: int) -> NDArray[np.float32]:
        """Return the bands' frequencies in cycles per degree, (6,): the Nyquist, then halves.

        `width` is that of the image, in pixels.
        """
        nyquist = width / self.view.width_deg(width) / 2
        return np.asarray(nyquist * 0.5 ** np.arange(BANDS), dtype=np.float32)

    def band_weights(self, width: int) -> NDArray[np.float32]:
        """Return how much more contrast each band needs than the best visible frequency, (6,).

        `width` is that of the image, in pixels. Weights are finite even at invisible frequencies,
        where an infinite weight times a contrast of 0 would be NaN.
        """
        peak = contrast_sensitivity(PEAK_FREQUENCY_CPD, PEAK_LUMINANCE)
        sensitivity = contrast_sensitivity(self.frequencies_cpd(width), PEAK_LUMINANCE)
        weights: NDArray[np.float32] = peak / np.maximum(sensitivity, peak / MOST_WEIGHT)
        return weights


def _colour_difference(reference: Percept, test: Percept, adaptation: Plane) -> Plane | None:
    """Return the squared distance in (a*, b*), 0 where it is too dark to see colour."""
    if reference.chroma is None or test.chroma is None:
        return None
    squared = reference.chroma - test.chroma
    squared *= squared
    distance: Plane = squared[0]
    distance += squared[1]
    # Yee's program, which made the goldens, compares the square itself with the elevation.
    distance[adaptation < COLOUR_LUMINANCE] = 0
    return distance


def _exceeds(
    luminance_difference: Plane, threshold: Plane, colour: Plane | None, elevation: Plane | float
) -> Mask:
    """Return which pixels differ visibly in luminance or colour at this threshold elevation."""
    visible: Mask = luminance_difference > elevation * threshold
    if colour is not None:
        visible |= colour > elevation
    return visible
