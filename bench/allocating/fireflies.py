"""The bias of the farm's allocator itself, on a grey film with rare bright samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.allocating.bias import Bias
from bench.allocating.film import JUDGING, OTHERS, ROUND, modelled, spread
from plateau.metric import Evidence, Half, View
from plateau.metric.allocation import plan_round
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.estimate import allowed_pixels

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

GREY, SIDE, ZONE, TARGET, PILOT = 0.2, 64, 16, 0.001, 100
#: The chance of a bright path per sample, and what it adds.
CASES: Final = {
    "2 % of +6": (0.02, 6.0),
    "1 in 500 of +30": (0.002, 30.0),
    "1 in 5,000 of +100": (2e-4, 100.0),
}


def study(report: Callable[[str, Bias], None], renders: int) -> None:
    """Report the bias of the mean of the film and of its zones."""
    for kind, (chance, bright) in CASES.items():
        truth = GREY + chance * bright
        means = np.stack([_render(chance, bright, seed) for seed in range(renders)]) / truth - 1
        whole = means.mean(axis=(1, 2))
        doubt = 1.96 * whole.std(ddof=1) / np.sqrt(renders)
        report(f"allocator, {kind}", Bias(float(whole.mean()), float(doubt)))


def _render(chance: float, bright: float, seed: int) -> NDArray[np.float64]:
    """Return the mean of each zone of a film that the allocator ended."""
    rng, metric = np.random.default_rng(seed), CompiledVisibleDifferences(View())
    sums = np.zeros((ROUND, SIDE, SIDE))
    spp = np.zeros((SIDE // ZONE, SIDE // ZONE), np.int64)
    flying = np.zeros_like(spp) + PILOT
    allowed = allowed_pixels(TARGET, SIDE**2)
    while True:
        each = spread(flying, ZONE, sums[0]) // ROUND
        sums += GREY * each + bright * rng.binomial(each, chance, sums.shape)
        spp += flying
        seen = _evidence(sums, spp, metric, JUDGING)
        assert seen.estimate is not None
        if seen.estimate.pixels <= allowed:
            zones = sums.sum(axis=0) / spread(spp, ZONE, sums[0])
            means: NDArray[np.float64] = zones.reshape(SIDE // ZONE, ZONE, -1, ZONE).mean((1, 3))
            return means
        plan = plan_round(
            metric,
            *modelled(_evidence(sums, spp, metric, OTHERS)),
            TARGET,
            spp=spp,
            planned=spp,
            size=ZONE,
        )
        flying = plan.zones * (-(-plan.spp // ROUND) * ROUND)  # the same in each quarter


def _evidence(
    sums: NDArray[np.float64],
    spp: NDArray[np.int64],
    metric: CompiledVisibleDifferences,
    split: Any,
) -> Evidence:
    half = spread(spp, ZONE, sums[0]) / 2
    grey = [((sums[one] + sums[other]) / half)[..., np.newaxis] for one, other in split]
    even, odd = (np.repeat(plane, 3, axis=-1).astype(np.float32) for plane in grey)
    image = ((even + odd) / 2).astype(np.float32)
    return Evidence(2, image, (Half(even, 1), Half(odd, 1)), metric)
