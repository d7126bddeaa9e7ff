"""Whether what a process holds is flat: a robust trend after the warm-up, with a bound."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

#: The share of a run in which caches may fill.
WARM_UP: Final = 1 / 3
#: The share of a run behind each of the figures start, middle and end.
_SHOWN: Final = 1 / 10


@dataclass(frozen=True, kw_only=True)
class Trend:
    """How something went: medians of a tenth of the run each, and the growth after the warm-up."""

    start: float
    middle: float
    end: float
    growth: float


def trend(times: Sequence[float], values: Sequence[float]) -> Trend:
    """Return how the values went over these times, which rise.

    The growth is the median slope between any two values after the warm-up (Theil and Sen), times
    the time that they cover. So neither a peak nor a restart is taken for growth, and no level.
    """
    t, v = np.asarray(times, float), np.asarray(values, float)
    share = (t - t[0]) / (t[-1] - t[0])
    judged = share >= WARM_UP
    first, second = np.triu_indices(int(judged.sum()), 1)
    slopes = (v[judged][second] - v[judged][first]) / (t[judged][second] - t[judged][first])
    return Trend(
        start=float(np.median(v[share <= _SHOWN])),
        middle=float(np.median(v[abs(share - 0.5) <= _SHOWN])),
        end=float(np.median(v[share >= 1 - _SHOWN])),
        growth=float(np.median(slopes) * np.ptp(t[judged])),
    )
