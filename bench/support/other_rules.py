"""Stopping rules of other renderers, by their published formulas, on our slices.

They serve comparison alone; no job can name them. If a product does more than its formula, the
class says so.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plateau.metric import Image, Mask, View
from plateau.metric.display import Plane, displayed

#: The gamma at the end of LuxCore's image pipeline.
LUXCORE_GAMMA = 2.2
#: Cycles multiplies the threshold that a user sets by this.
CYCLES_FACTOR = 5.0
#: Keeps Cycles' error finite in black pixels.
CYCLES_EPSILON = 1e-4


@dataclass
class LuxCoreHalt:
    """LuxCore's noise threshold: ends a render when no displayed pixel changes any more.

    Each check compares the displayed image, with values from 0 to 1, with that of the check before.
    The render ends when no channel of any pixel differs by more than `threshold`. The caller
    chooses the distance between checks.

    The product displays the render by its tone mapping; here our view does, with the same gamma.
    Its default threshold is 5/256, rounded here to 0.02 (LuxCoreRender/LuxCore,
    src/slg/film/convtest/filmconvtest.cpp, Apache-2.0); warm-up and step are 64 spp by default.
    """

    view: View
    threshold: float = 0.02
    warm_up_spp: int = 64

    _before: Image | None = field(default=None, init=False)

    def stops(self, spp: int, image: Image) -> bool:
        """Return whether the render ends with this image; keep the image for the next check."""
        if spp <= self.warm_up_spp:
            return False
        before, self._before = self._before, luxcore_displayed(image, self.view)
        # A NaN exceeds no threshold, as in LuxCore.
        return before is not None and not (np.abs(self._before - before) > self.threshold).any()


def luxcore_displayed(image: Image, view: View) -> Image:
    """Return an image's displayed values with gamma, (H, W, 3) float32 in [0, 1]."""
    encoded: Image = np.power(displayed(image, view), np.float32(1 / LUXCORE_GAMMA))
    return encoded


def cycles_error(image: Image, half: Image) -> Plane:
    """Return Cycles' error of each pixel, (H, W), of an image I and of A, half of its samples.

    That is |I - A| summed over the channels, divided by 1e-4 plus s, or plus the square root of s
    if s is under 1, where s is the sum of I (Blender, Apache-2.0,
    intern/cycles/kernel/film/adaptive_sampling.h). It is after H. Dammertz et al., A hierarchical
    automatic stopping condition for Monte Carlo global illumination, WSCG 2010, section 2.1, except
    for s of 1 or more.
    """
    total = np.maximum(image.sum(axis=-1), np.float32(0))  # a negative sum has no root
    scale = np.where(total < 1, np.sqrt(total), total)
    error: Plane = np.divide(np.abs(image - half).sum(axis=-1), np.float32(CYCLES_EPSILON) + scale)
    return error


@dataclass(frozen=True)
class CyclesThreshold:
    """Cycles' noise threshold: an image is done when the error of every pixel is under it.

    It stops sampling a single pixel as soon as that pixel is done: see `CyclesAdaptive`. The factor
    of 5 and the default minimum are those of intern/cycles/scene/integrator.cpp.
    """

    threshold: float = 0.01
    min_spp: int = 64

    def done(self, image: Image, half: Image) -> Mask:
        """Return the pixels that are done, (H, W). A NaN never is."""
        done: Mask = cycles_error(image, half) < CYCLES_FACTOR * self.threshold
        return done

    def stops(self, spp: int, image: Image, half: Image) -> bool:
        """Return whether every pixel is done."""
        return spp > self.min_spp and bool(self.done(image, half).all())


@dataclass
class CyclesAdaptive:
    """Cycles' adaptive sampling: each pixel ends by itself, unless a neighbour is unfinished.

    It takes samples two slices at a time; the first of each two make up A. A finished pixel gets no
    samples until one of its eight neighbours is found unfinished.
    Cycles checks every 16 spp.
    """

    rule: CyclesThreshold = field(default_factory=CyclesThreshold)

    _total: NDArray[np.float64] | None = field(default=None, init=False)
    _half: NDArray[np.float64] | None = field(default=None, init=False)
    _spp: NDArray[np.int64] | None = field(default=None, init=False)
    _active: Mask | None = field(default=None, init=False)

    @property
    def mean_spp(self) -> float:
        """The mean samples per pixel."""
        return 0.0 if self._spp is None else float(self._spp.mean())

    @property
    def image(self) -> Image:
        """The image of these samples, (H, W, 3) float32."""
        return _normalised(self._total)

    def add(self, first: NDArray[Any], second: NDArray[Any], spp: int) -> bool:
        """Add two slices to the unfinished pixels; return whether all pixels are finished.

        `first` and `second` are films before normalisation, (H, W, 4), with `spp` in all.
        """
        if self._total is None or self._half is None or self._spp is None or self._active is None:
            self._total, self._half = np.zeros(first.shape), np.zeros(first.shape)
            self._spp = np.zeros(first.shape[:2], np.int64)
            self._active = np.ones(first.shape[:2], np.bool_)
        wanted = self._active
        self._half[wanted] += first[wanted]
        self._total[wanted] += first[wanted].astype(np.float64) + second[wanted]
        self._spp[wanted] += spp
        done = self.rule.done(_normalised(self._total), _normalised(self._half))
        unfinished = wanted & ~(done & (self._spp > self.rule.min_spp))
        self._active = with_neighbours(unfinished)
        return not unfinished.any()


def with_neighbours(pixels: Mask) -> Mask:
    """Return the pixels and their eight neighbours."""
    padded = np.pad(pixels, 1)
    height, width = pixels.shape
    shifted = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    grown: Mask = np.any(shifted, axis=0)
    return grown


def _normalised(total: NDArray[np.float64] | None) -> Image:
    assert total is not None
    image: Image = (total[..., :3] / total[..., 3:]).astype(np.float32)
    return image
