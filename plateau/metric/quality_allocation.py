"""Which zones get the next samples, and how many, where the target is a quality in JOD.

What ColorVideoVDP finds lost is a sum over pixels, and almost only over those of the finest bands.
So every zone has a share of it (`plateau.metric.cvvdp.pooling.shares_by_zone`). The image has the
target's quality with the fewest samples where the last sample of each zone takes away as much.

References
----------
R. K. Mantiuk et al., ColorVideoVDP, ACM Transactions on Graphics 43(4), 2024. doi:10.1145/3658144.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.allocation import SMALL_ROUNDS, next_round, require_zones, samples_after
from plateau.metric.cvvdp.parameters import DIFFERENCE_EXPONENT, JOD_EXPONENT
from plateau.metric.quality import BEST_JOD, FURTHEST, LEAST_LOST, QualityModel
from plateau.metric.zone_noise import zone_sums

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.allocation import Allocation, RoundSizes
    from plateau.metric.display import View
    from plateau.metric.noise_model import NoiseModel
    from plateau.metric.zone_noise import Floats

#: The loss to aim at, as a share of the target's, and the most, as a share of the present one.
_AIM, _MOST = 0.95, 0.97
#: Every zone loses at least this share of the whole.
_LEAST = 1e-9


def plan_by_quality(
    model: NoiseModel,
    view: View,
    target: float,
    *,
    spp: NDArray[np.int64],
    planned: NDArray[np.int64],
    size: int,
    sizes: RoundSizes = SMALL_ROUNDS,
) -> Allocation:
    """Return the zones and samples of the next round.

    Parameters
    ----------
    model, view
        The noise model of the merged image, and how it is viewed. The model should be that of other
        halves than those that judge the image, as for `plateau.metric.allocation.plan_round`.
    target
        The quality to reach, in JOD, below 10.
    spp, planned, size, sizes
        As for `plan_round`.

    Raises
    ------
    ValueError
        If the image is smaller than 4 by 4 pixels, or `spp` and `planned` do not fit its zones.

    Notes
    -----
    It takes two comparisons, and depends on its arguments alone. A zone of A_z pixels that has n_z
    samples in each has the share L_z of the loss Q⁴, and another sample takes away as G_z/n_z. It
    needs, with the price λ of a sample,

        n*_z = n_z max(1, (G_z / (A_z n_z λ))^(1/(1 + p)))  with  Σ L_z (n*_z/n_z)^-p = r Σ L_z,

    where p = 2.264 is the model's exponent of differences, and r = min(0.97, 0.95 (Q*/Q)²) for the
    target's pooled difference Q* and the present Q; 10 - JOD is a power of Q. The price is found by
    bisection. A difference near the greatest falls more slowly at first. So the exponent is too
    large for noisy zones now, and right later: the next image tells. Steps by each zone's present
    exponent are too long.

    A pixel of a coarser band belongs to the zone of its first pixel of the image. Pixels that are
    not finite lose nothing.

    Examples
    --------
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> from plateau.metric.noise_model import noise_model
    >>> noise = np.random.default_rng(1).normal(0, 0.02, (2, 64, 64, 3)).astype(np.float32)
    >>> noise[:, :32, 32:] *= 4
    >>> even, odd = np.float32(0.4) + noise
    >>> view, halves = View(), (Half(even, 50), Half(odd, 50))
    >>> model = noise_model(VisibleDifferences(view), (even + odd) / 2, halves)
    >>> spp = np.full((2, 2), 100)
    >>> plan = plan_by_quality(model, view, 9.9, spp=spp, planned=spp, size=32)
    >>> bool(plan.zones[0, 1]), bool(plan.needed[0, 1] > 2 * plan.needed[1, 0])
    (True, True)
    """
    pixels = zone_sums(np.ones(model.non_finite.shape), size)
    require_zones(pixels.shape, spp, planned)
    quality = QualityModel(model, view, zone_size=size, heat=False).quality
    assert quality.zones is not None  # as asked
    aim, now = (max(BEST_JOD - jod, LEAST_LOST) for jod in (target, quality.jod))
    ratio = min(_MOST, _AIM * (aim / now) ** (2 / JOD_EXPONENT))
    fewest = samples_after(planned, pixels, sizes)
    needed = _needed(quality.zones, pixels, spp, planned, ratio, fewest)
    return next_round(needed, planned, pixels, sizes)


def _needed(
    shares: Floats,
    pixels: Floats,
    spp: NDArray[np.int64],
    planned: NDArray[np.int64],
    ratio: float,
    least: float,
) -> Floats:
    """Return the samples per pixel of each zone that leave this ratio of the loss.

    They are at least `least` samples in all, so that the next round can be chosen from them.
    """
    lost, falls = shares
    if not lost.any():  # nothing can be seen at all
        return planned.astype(np.float64)
    slopes = np.log(np.maximum(falls, _LEAST * lost.sum()) / (pixels * spp))

    def growth(price: float) -> Floats:
        steps = (slopes - price) / (1 + DIFFERENCE_EXPONENT)
        grown: Floats = np.exp(np.clip(steps, 0, math.log(FURTHEST)))
        return grown

    def is_enough(price: float) -> bool:
        grown = growth(price)
        left = (lost * grown**-DIFFERENCE_EXPONENT).sum()
        spent = (np.maximum(spp * grown, planned) * pixels).sum()
        return bool(left <= ratio * lost.sum() and spent >= least)

    # From a price at which every zone grows as far as it may, to one at which none does.
    low = float(slopes.min()) - (1 + DIFFERENCE_EXPONENT) * math.log(FURTHEST)
    high = float(slopes.max())
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if is_enough(middle) else (low, middle)
    return np.maximum(spp * growth(low), planned)
