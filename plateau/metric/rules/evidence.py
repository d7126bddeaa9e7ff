"""The input of every stopping rule at an evaluation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.allocation import LARGE_ROUNDS, SMALL_ROUNDS, Allocation, plan_round
from plateau.metric.cvvdp import LEAST_SIZE
from plateau.metric.display import as_image, finite_pixels
from plateau.metric.estimate import Estimate, estimate_from
from plateau.metric.fireflies import hidden_light
from plateau.metric.forecasts import forecast_from, when_determined
from plateau.metric.noise_model import Half, NoiseModel, noise_model
from plateau.metric.quality import BEST_JOD, BLOCK, LEAST_LOST, Quality, QualityModel, doubted
from plateau.metric.quality_allocation import plan_by_quality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.blend import BlendError
    from plateau.metric.display import Image, Mask
    from plateau.metric.standard_error import Quarters
    from plateau.metric.vdp import Percept, VisibleDifferences


@dataclass(frozen=True, eq=False)
class Evidence:
    """The images of one evaluation. What several rules need is computed once, on first use.

    Raises
    ------
    ValueError
        If there is no sample, or the samples of the halves do not add up to `spp`.
    """

    #: Samples per pixel in the merged image.
    spp: int
    #: The merged image: (H, W, 3) float32 linear radiance.
    image: Image
    #: The even- and the odd-indexed slices; None while there are fewer than two slices.
    halves: tuple[Half, Half] | None
    #: The predictor, for the view under which to judge.
    metric: VisibleDifferences
    #: The error of a denoised image, which is not that of its halves.
    error: BlendError | None = None
    #: Four parts of the slices, for rules `by_quarters`; None while there are fewer than four.
    quarters: Quarters | None = None
    #: Whether any pixel has light, before a view transform; None without one.
    light: bool | None = None

    def __post_init__(self) -> None:
        if self.spp < 1:
            raise ValueError(f"an evaluation needs at least 1 spp, not {self.spp}")
        halves = self.spp if self.halves is None else sum(half.spp for half in self.halves)
        if self.halves is not None and not self.spp <= halves < self.spp + 1:
            even, odd = self.halves
            raise ValueError(f"halves of {even.spp} and {odd.spp} spp do not make {self.spp} spp")

    @property
    def pixels(self) -> int:
        """How many pixels the image has."""
        height, width = self.percept.shape
        return height * width

    @cached_property
    def finite(self) -> Mask:
        """Which pixels of the merged image are neither NaN nor infinite, (H, W) bool."""
        return finite_pixels(as_image(self.image))

    @cached_property
    def is_lit(self) -> bool:
        """Whether any pixel has light, as rendered: a view transform may show black as grey."""
        if self.light is not None:
            return self.light
        return bool((self.image[self.finite] > 0).any())

    @property
    def halves_agree(self) -> bool:
        """Whether the halves have the same light everywhere, as an image without noise has."""
        if self.halves is None:
            return False
        even, odd = self.halves
        return np.array_equal(even.mean, odd.mean)

    @cached_property
    def percept(self) -> Percept:
        """The merged image, prepared for comparison."""
        return self.metric.percept(self.image)

    def prepare(self) -> None:
        """Compute what all rules need, so that they may judge on several threads."""
        _ = self._model, self.finite

    @cached_property
    def _model(self) -> tuple[NoiseModel, Percept] | None:
        """The noise model of the merged image, and the percept of its clean image."""
        if self.error is not None:
            model = self.error.likely
        elif self.halves is not None:
            model = noise_model(self.metric, self.image, self.halves)
        else:
            return None
        return model, self.metric.percept(model.clean)

    @cached_property
    def estimate(self) -> Estimate | None:
        """The estimate of visible pixels; None where the image's error is not known.

        The band of a denoised image has all that its error may be.
        """
        if self._model is None:
            return None
        estimate = estimate_from(self.metric, *self._model)
        if self.error is None:
            return estimate
        _, clean = self._model
        greatest = estimate_from(self.metric, self.error.greatest, clean)
        return replace(
            estimate,
            high_pixels=max(estimate.high_pixels, greatest.pixels),
            greatest_pixels=greatest.pixels,
        )

    @cached_property
    def quality(self) -> Quality | None:
        """The quality by ColorVideoVDP; None where the image's error is not known.

        It is at least what fireflies leave of it, and that of a denoised image what the doubt about
        its error leaves. An image of less than 4 by 4 pixels has none.
        """
        model, view = self._quality_model, self.metric.view
        if model is None:
            return None
        hidden = None if self.halves is None else hidden_light(self.halves, view)
        quality = model.quality if hidden is None else model.against(hidden)
        if self.error is None:
            return quality
        most = QualityModel(self.error.greatest, view, zone_size=BLOCK, heat=False).quality
        least = min(quality.low_jod, doubted(model.quality, most))
        return replace(quality, low_jod=least, zones=None)

    @cached_property
    def _quality_model(self) -> QualityModel | None:
        if self._model is None or not self._has_quality:
            return None
        zone_size = None if self.error is None else BLOCK
        return QualityModel(self._model[0], self.metric.view, zone_size=zone_size)

    @property
    def _has_quality(self) -> bool:
        return bool(min(self.image.shape[:2]) >= LEAST_SIZE)

    def quality_forecast(self, target: float) -> int | None:
        """Return the spp at which the quality surely reaches this target in JOD, if known."""
        model, quality = self._quality_model, self.quality
        if model is None or quality is None:
            return None
        doubt = (BEST_JOD - quality.low_jod) / max(BEST_JOD - quality.jod, LEAST_LOST)
        return model.forecast(BEST_JOD - (BEST_JOD - target) / max(doubt, 1), spp=self.spp)

    def allowed_pixels(self, target: float) -> float:
        """Return how many visible pixels a target fraction allows."""
        return target * self.pixels

    @cached_property
    def kept_image(self) -> Image:
        """A read-only copy of the merged image, shared by all rules that keep it.

        The monitor may add further samples to the merged image itself.
        """
        image: Image = as_image(self.image).copy()
        image.flags.writeable = False
        return image

    def allocation(
        self,
        target: float,
        *,
        spp: NDArray[np.int64],
        planned: NDArray[np.int64],
        size: int,
        quality_target: float | None = None,
    ) -> Allocation | None:
        """Return the next round of samples by zones; None without halves.

        The parameters are those of `plateau.metric.allocation.plan_round`. A quality to reach, in
        JOD, counts instead of the noise, where the image has a quality (`plan_by_quality`). Rounds
        of a denoised image are large. Where its likely error is small enough, the greatest counts.
        """
        if self._model is None:
            return None
        model, clean = self._model
        sizes = SMALL_ROUNDS if self.error is None else LARGE_ROUNDS
        if quality_target is not None and self._has_quality:
            if self.error is not None:
                likely = self._quality_model
                assert likely is not None  # as there is a model, of an image that has a quality
                model = model if likely.quality.low_jod < quality_target else self.error.greatest
            return plan_by_quality(
                model,
                self.metric.view,
                quality_target,
                spp=spp,
                planned=planned,
                size=size,
                sizes=sizes,
            )
        estimate = self.estimate
        assert estimate is not None  # as there is a model
        if self.error is not None and estimate.pixels <= self.allowed_pixels(target):
            model = self.error.greatest
            estimate = estimate_from(self.metric, model, clean)
        return plan_round(
            self.metric,
            model,
            clean,
            estimate,
            target,
            spp=spp,
            planned=planned,
            size=size,
            sizes=sizes,
        )

    def forecast(self, target: float) -> int | None:
        """Return the spp at which this fraction of the pixels is left; None if out of reach.

        It is None without halves, too.
        """
        if self._model is None or self.estimate is None:
            return None
        found = forecast_from(self.metric, *self._model, self.estimate, target, spp=self.spp)
        return when_determined(found, self.estimate, self.allowed_pixels(target), spp=self.spp)
