"""The bias of deciding by the samples that one keeps, on pixels with rare bright paths.

Each pixel of a zone has a light of 1 and, with a small chance per sample, much more. A zone gets
samples until the standard error of its pixels is small enough, by its own samples. Kirk and Arvo
showed that such decisions bias a mean (Unbiased sampling techniques for image synthesis, SIGGRAPH
1991): who has met no bright path stops early.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.support.report import Figure

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Counts = NDArray[np.int64]

#: The chance of a bright path per sample, and what it adds to a light of 1.
CASES: Final = {"2 % of +10": (0.02, 10.0), "1 in 50,000 of +10,000": (2e-5, 1e4)}
#: Sides of zones in pixels, and by what they decide.
SIDES: Final = (1, 4, 16, 32)
DECIDED: Final = ("all", "halves")
#: A pilot, the most samples, and those that a zone of average luck needs.
_FIRST, _MOST, _NEEDED = 200, 6400, 800


@dataclass(frozen=True)
class Bias:
    """The error of the mean over many zones."""

    relative: float  #: the mean error over the mean
    #: Half the width of its 95 % confidence interval.
    doubt: float

    def figures(self, name: str) -> list[Figure]:
        """Return it for a report."""
        both = {"mean": self.relative, "doubt": self.doubt}
        return [
            Figure(name=f"bias: {name}: {what}", value=value, unit="fraction of the mean")
            for what, value in both.items()
        ]


def bias(chance: float, bright: float, pixels: int, zones: int, *, own: bool, seed: int) -> Bias:
    """Return the bias of zones of so many pixels.

    With `own` a zone decides by the noise of all its samples; otherwise by a contrast of its
    quarters that the image's own halves do not show.
    """
    rng = np.random.default_rng(seed)
    hits = np.zeros((zones, pixels, 4))
    spp = np.zeros(zones, np.int64)
    active = np.ones(zones, np.bool_)
    energy = _variance if own else _contrast
    enough = chance * (1 - chance) / _NEEDED
    while active.any():
        more = np.where(spp == 0, _FIRST, spp // 4 // 4 * 4) * active
        hits += rng.binomial((more // 4)[:, np.newaxis, np.newaxis], chance, hits.shape)
        spp += more
        active = (energy(hits, spp) > enough) & (spp < _MOST)
    means = 1 + bright * hits.sum(axis=2).mean(axis=1) / spp
    truth = 1 + bright * chance
    doubt = 1.96 * means.std() / np.sqrt(zones)
    return Bias(float(means.mean() / truth - 1), float(doubt / truth))


def _variance(hits: NDArray[np.float64], spp: Counts) -> NDArray[np.float64]:
    """Return the variance of a pixel's share of bright samples."""
    share = hits.sum(axis=2) / spp[:, np.newaxis]
    variance: NDArray[np.float64] = (share * (1 - share)).mean(axis=1) / spp
    return variance


def _contrast(hits: NDArray[np.float64], spp: Counts) -> NDArray[np.float64]:
    """Return the same from the difference of two halves, as the farm's allocator sees it."""
    apart = (hits[..., :2].sum(axis=2) - hits[..., 2:].sum(axis=2)) / spp[:, np.newaxis]
    energy: NDArray[np.float64] = np.square(apart).mean(axis=1)
    return energy


def study(report: Callable[[str, Bias], None]) -> None:
    """Report the bias of zones of several sizes."""
    for kind, (chance, bright) in CASES.items():
        for side in SIDES:
            pixels = side * side
            zones = max(1_000_000 // pixels, 1000)
            for by in DECIDED:
                found = bias(chance, bright, pixels, zones, own=by == "all", seed=side)
                report(f"{kind}, {side} px, {by}", found)
