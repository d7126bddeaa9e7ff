"""The quality of an image in JOD, estimated without the converged image.

As in `plateau.metric.estimate`, T, the image without its noise, stands for the converged image, and
N, noise like the image's own, for the error: ColorVideoVDP compares T with T + N and with T - N.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.cvvdp import ColorVideoVDP, Display
from plateau.metric.cvvdp.parameters import JOD_EXPONENT
from plateau.metric.display import PIXELS_PER_DEGREE, displayed
from plateau.metric.rows import by_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.cvvdp import Percept
    from plateau.metric.cvvdp import Quality as Comparison
    from plateau.metric.display import Image, Plane, View
    from plateau.metric.noise_model import NoiseModel

#: The quality of an image in which nobody sees an error, in JOD.
BEST_JOD = 10.0
#: The share of what is lost by which the estimate may be off, in nine cases of ten.
MODEL_ERROR = 0.05
#: The same for a denoised image, whose error has not quite the shape of the noise in its place.
DENOISED_ERROR = 0.15
#: Side of a block in pixels: farther than the error of a denoised image is pooled over.
BLOCK = 32
#: The farthest forecast, as a multiple of the present samples.
FURTHEST = 1000.0
#: The most evaluations in a forecast; each costs one comparison.
EVALUATIONS = 4
#: The search ends when the spp changes by less than this factor.
FINE_ENOUGH = 1.02
#: What is lost falls as a power of the samples: the initial guess of that power.
FIRST_POWER = 0.5
#: Less than this is nothing lost, in JOD.
LEAST_LOST = 1e-6


@dataclass(frozen=True)
class Quality:
    """The quality of an image against the converged one, in JOD, as estimated."""

    #: 10 where nobody sees an error; one less where three of four prefer the converged image.
    jod: float
    #: It is at least this in about nine cases of ten.
    low_jod: float
    #: Whether that is less by light that fireflies hide.
    has_fireflies: bool = False
    #: Where a person would see the noise, (H, W) float32 of 0 or more: what is lost, over 10 JOD.
    heat: Plane | None = field(default=None, repr=False, compare=False)
    #: What each zone has of what is lost, if asked: see `plateau.metric.cvvdp.pooling`.
    zones: NDArray[np.float64] | None = field(default=None, repr=False, compare=False)


class QualityModel:
    """A noise model on the screen of a view, before the eye of ColorVideoVDP.

    Parameters
    ----------
    model
        The image without its noise, and the noise. Pixels that are not finite count as equal.
    view
        The screen, the room and the distance.
    zone_size
        Side of zones in pixels: the quality has their shares.
    heat
        Whether the quality has its map.

    Raises
    ------
    ValueError
        If the image is smaller than 4 by 4 pixels.

    Examples
    --------
    >>> import numpy as np
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> from plateau.metric.noise_model import noise_model
    >>> noise = np.random.default_rng(1).normal(0, 0.02, (2, 64, 64, 3)).astype(np.float32)
    >>> even, odd = np.float32(0.4) + noise
    >>> halves = Half(even, 50), Half(odd, 50)
    >>> image, view = (even + odd) / 2, View()
    >>> model = QualityModel(noise_model(VisibleDifferences(view), image, halves), view)
    >>> model.quality.low_jod < model.quality.jod < 10
    True
    >>> 100 < model.forecast(9.9, spp=100) < 100_000
    True
    """

    def __init__(
        self, model: NoiseModel, view: View, *, zone_size: int | None = None, heat: bool = True
    ) -> None:
        self._model, self._view = model, view
        self._eye = ColorVideoVDP(display_of(view, model.clean.shape[1]))
        self._clean = self._eye.percept(displayed(model.clean, view))
        both = [self._compared(amount, heat=heat, zone_size=zone_size) for amount in (1.0, -1.0)]
        lost = BEST_JOD - min(one.jod for one in both)
        maps = [one.heat for one in both if one.heat is not None]
        zones = [one.zones for one in both if one.zones is not None]
        self.quality = Quality(
            jod=sum(one.jod for one in both) / 2,
            low_jod=BEST_JOD - lost * (1 + MODEL_ERROR),
            heat=(maps[0] + maps[1]) / np.float32(2) if maps else None,
            zones=(zones[0] + zones[1]) / 2 if zones else None,
        )

    def at(self, amount: float) -> float:
        """Return the quality in JOD with `amount` times the noise: ±1 is the present noise."""
        return self._compared(amount).jod

    def against(self, hidden: Image) -> Quality:
        """Return the quality beside a converged image that has this light of fireflies, too."""
        clean = self._eye.percept(displayed(self._model.clean + hidden, self._view))
        lost = BEST_JOD - min(self._compared(amount, clean).jod for amount in (1.0, -1.0))
        low_jod = BEST_JOD - lost * (1 + MODEL_ERROR)
        if low_jod >= self.quality.low_jod:
            return self.quality
        return replace(self.quality, low_jod=low_jod, has_fireflies=True)

    def _compared(
        self,
        amount: float,
        clean: Percept | None = None,
        *,
        heat: bool = False,
        zone_size: int | None = None,
    ) -> Comparison:
        shown = np.empty(self._model.clean.shape, np.float32)
        by_rows(self._show, shown.shape[:2], amount, shown)
        noisy = self._eye.percept(shown)
        return self._eye.compare(clean or self._clean, noisy, heat=heat, zone_size=zone_size)

    def _show(self, first: int, last: int, amount: float, out: Image) -> None:
        noisy = self._model.rows(first, last).finite_noisy(amount)
        out[first:last] = displayed(noisy, self._view)

    def forecast(self, target: float, *, spp: int) -> int | None:
        """Return the spp at which the quality reaches a target in JOD; None if out of reach.

        Notes
        -----
        At n' samples per pixel the noise is sqrt(n/n') times that at n, for an image of n = `spp`.
        What is lost is close to a power of n', of which each evaluation gives a better exponent.
        """
        allowed = math.log(BEST_JOD - target)
        start = here = _log_lost(self.quality.jod)
        place, power = 0.0, FIRST_POWER
        for evaluation in range(EVALUATIONS):
            if here <= allowed and place == 0:
                return spp
            step = (here - allowed) / power
            if evaluation and abs(step) < math.log(FINE_ENOUGH):
                break
            if place + step > math.log(FURTHEST):
                return None
            place = max(place + step, 0.0)
            here = _log_lost(self.at(math.exp(-place / 2)))
            power = max((start - here) / place, FIRST_POWER / 4) if place else power
        return math.ceil(spp * math.exp(place))


def doubted(likely: Quality, greatest: Quality) -> float:
    """Return the least quality of an image, in JOD, whose error is measured with doubt.

    Parameters
    ----------
    likely
        The quality by the error that is likely, with the shares of its blocks.
    greatest
        The quality by two standard errors more at each place, with those shares.

    Notes
    -----
    Other pixels measure the error of each block, so doubts of blocks add as their squares do. With
    the shares L_z of Q⁴ and M_z = L_z / √Σ L, Q² is Σ M_z up to a factor, and surely no more than
    Σ M_z + √Σ ΔM_z², where ΔM_z is what the greatest error adds. A larger image leaves less doubt.

    Examples
    --------
    >>> likely, greatest = (Quality(9.5, 9.4, zones=np.full((2, 4, 4), n)) for n in (1.0, 2.0))
    >>> round(doubted(likely, greatest), 2)
    9.4
    """
    assert likely.zones is not None  # as asked
    assert greatest.zones is not None
    lost, more = likely.zones[0], greatest.zones[0]
    if not lost.any():
        return greatest.low_jod
    parts, with_doubt = (one / math.sqrt(one.sum()) for one in (lost, more))
    ratio = 1 + float(np.linalg.norm(with_doubt - parts)) / float(parts.sum())
    most = (BEST_JOD - likely.jod) * float(ratio ** (JOD_EXPONENT / 2))
    return BEST_JOD - most * (1 + DENOISED_ERROR)


def _log_lost(jod: float) -> float:
    return math.log(max(BEST_JOD - jod, LEAST_LOST))


def display_of(view: View, width: int) -> Display:
    """Return the display of a view of an image of this width, for displayed linear light.

    Examples
    --------
    >>> from plateau.metric import View
    >>> display = display_of(View(), 256)
    >>> round(display.pixels_per_degree, 2), display.peak, display.black
    (20.0, 200.0, 0.2)
    """
    coarsest, finest = PIXELS_PER_DEGREE  # coarser and finer pixels are as these
    return Display(
        pixels_per_degree=min(max(width / view.width_deg(width), coarsest), finest),
        peak=view.white_luminance,
        black=view.white_luminance / view.contrast,
        ambient_lux=view.ambient_lux,
        transfer="relative",
        primaries=view.primaries,
    )
