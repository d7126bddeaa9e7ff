"""The forecast of the samples at which the estimate falls to a target.

The error of the merged image I at n samples per pixel shrinks as 1/sqrt(n): at n' it is sqrt(n/n')
times that at n. With T for the truth and N for the error (see `plateau.metric.estimate`),
D(T, T + sqrt(n/n') N) forecasts the estimate at n'.
"""

import math
from dataclasses import dataclass, field

from plateau.metric.estimate import DETERMINED, Estimate, require_target
from plateau.metric.noise_model import NoiseModel
from plateau.metric.vdp import Percept, VisibleDifferences

#: The farthest forecast, as a multiple of the present samples.
FURTHEST = 1000.0
#: The most evaluations in a forecast.
MOST_EVALUATIONS = 5
#: The search ends when the spp is known to this factor.
FINE_ENOUGH = 1.03
#: The count falls as a power of the samples: the initial guess of that power, and its range.
FIRST_POWER = 2.0
LEAST_POWER, MOST_POWER = 0.5, 8.0


@dataclass
class _Search:
    """The search of a zero crossing in logarithmic coordinates, from the present onwards."""

    #: (ln n'/n, ln of the count over the allowed one), the last points above and below the target.
    above: tuple[float, float]
    below: tuple[float, float] | None = field(default=None)
    #: How fast the count falls, as a power of the samples.
    power: float = FIRST_POWER

    def add(self, point: tuple[float, float]) -> None:
        """Take in one point."""
        left, right = (self.above, point) if point[0] > self.above[0] else (point, self.above)
        if right[0] > left[0]:
            slope = (left[1] - right[1]) / (right[0] - left[0])
            self.power = min(max(slope, LEAST_POWER), MOST_POWER)
        if point[1] > 0:
            self.above = point
        else:
            self.below = point

    @property
    def crossing(self) -> float:
        """The best guess of where the count crosses the target."""
        (x, y), right = self.above, self.below
        if right is None or right[1] == y:
            return x + y / self.power
        return x + (right[0] - x) * y / (y - right[1])

    @property
    def fine_enough(self) -> bool:
        """Whether both sides are known and close to each other."""
        return self.below is not None and self.below[0] - self.above[0] < math.log(FINE_ENOUGH)


def forecast_from(
    metric: VisibleDifferences,
    model: NoiseModel,
    clean: Percept,
    estimate: Estimate,
    target: float,
    *,
    spp: int,
) -> int | None:
    """Return the spp at which the half-buffer estimate falls to a target fraction of the pixels.

    Parameters
    ----------
    metric
        The predictor, for the view under which to judge.
    model, clean
        The noise model of a merged image, and the percept of its clean image.
    estimate
        That of the merged image.
    target
        Fraction of the pixels, between 0 and 1.
    spp
        That of the merged image.

    Returns
    -------
    int or None
        At least `spp`; None if 1000 times as many are not enough, as for light not found yet.

    Raises
    ------
    ValueError
        If the target is not between 0 and 1.

    Notes
    -----
    It takes at most five evaluations, all with one sign of the noise; docs/science/stopping.md
    has how far it is right.
    """
    require_target(target)
    allowed = target * model.pixels
    if estimate.pixels <= allowed:
        return spp

    search = _Search(above=(0.0, _over(estimate.pixels, allowed)))
    furthest = math.log(FURTHEST)
    place = search.crossing
    for _ in range(MOST_EVALUATIONS):
        place = min(place, furthest)
        difference = metric.compare(clean, metric.percept(model.noisy(math.exp(-place / 2))))
        excess = _over(difference.finite_count, allowed)
        if excess > 0 and place == furthest:
            return None
        search.add((place, excess))
        place = search.crossing
        if search.fine_enough:
            break
    return None if place > furthest else _whole(spp, place)


def when_determined(
    found: int | None, estimate: Estimate, allowed: float, *, spp: int
) -> int | None:
    """Return the forecast, or a later one where the samples do not tell the error by then.

    Parameters
    ----------
    found
        When the likely error makes no more pixels visible than are allowed.
    estimate
        Of the present image, which has so many spp.
    allowed
        How many pixels may be visible.

    Notes
    -----
    The pixels of the greatest error are taken to become fewer by the same power of the samples as
    those of the likely one.
    """
    if found is None or estimate.greatest_pixels is None:
        return found
    sooner = math.log(found / spp)
    power = FIRST_POWER
    if sooner > 0:
        slope = _over(estimate.pixels, allowed) / sooner
        power = min(max(slope, LEAST_POWER), MOST_POWER)
    place = _over(estimate.greatest_pixels, DETERMINED * allowed) / power
    if place <= sooner:
        return found
    return None if place > math.log(FURTHEST) else _whole(found, place - sooner)


def _over(pixels: float, allowed: float) -> float:
    """Return the logarithm of a count over the allowed one, finite for a count of 0 too."""
    return math.log((pixels + 0.5) / (allowed + 0.5))


def _whole(spp: int, place: float) -> int:
    return math.ceil(spp * math.exp(place))
