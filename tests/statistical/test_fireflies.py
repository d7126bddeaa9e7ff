"""The farm's allocator loses no light of rare bright samples on a grey film."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.support.film import JUDGING, OTHERS, ROUND, modelled, spread
from plateau.metric import Evidence, Half
from plateau.metric.allocation import plan_round
from plateau.metric.compiled import CompiledVisibleDifferences
from tests.support.images import PAPER

GREY, SIDE, ZONE, TARGET, PILOT, RENDERS = 0.2, 64, 16, 0.001, 100, 4


@pytest.mark.parametrize(("chance", "bright"), [(0.02, 6.0), (0.002, 30.0), (2e-4, 100.0)])
def test_the_mean_has_the_light_of_fireflies(chance: float, bright: float) -> None:
    truth = GREY + chance * bright
    means = np.array([render(chance, bright, seed).mean() for seed in range(RENDERS)]) / truth - 1
    doubt = 1.96 * means.std(ddof=1) / np.sqrt(RENDERS)
    assert abs(means.mean()) < 3 * doubt < 0.02


def render(chance: float, bright: float, seed: int) -> NDArray[np.float64]:
    """Return the mean of each zone of a film that the allocator ended."""
    rng, metric = np.random.default_rng(seed), CompiledVisibleDifferences(PAPER)
    sums = np.zeros((ROUND, SIDE, SIDE))
    spp = np.zeros((SIDE // ZONE, SIDE // ZONE), np.int64)
    flying = np.zeros_like(spp) + PILOT
    while True:
        each = spread(flying, ZONE, sums[0]) // ROUND
        sums += GREY * each + bright * rng.binomial(each, chance, sums.shape)
        spp += flying
        estimate = evidence(sums, spp, metric, JUDGING).estimate
        assert estimate is not None
        if estimate.pixels <= TARGET * SIDE**2:
            zones = sums.sum(axis=0) / spread(spp, ZONE, sums[0])
            return zones.reshape(SIDE // ZONE, ZONE, -1, ZONE).mean((1, 3))
        others = modelled(evidence(sums, spp, metric, OTHERS))
        plan = plan_round(metric, *others, TARGET, spp=spp, planned=spp, size=ZONE)
        flying = plan.zones * (-(-plan.spp // ROUND) * ROUND)  # the same in each quarter


def evidence(
    sums: NDArray[np.float64],
    spp: NDArray[np.int64],
    metric: CompiledVisibleDifferences,
    split: Any,
) -> Evidence:
    half = spread(spp, ZONE, sums[0]) / 2
    grey = [((sums[one] + sums[other]) / half)[..., np.newaxis] for one, other in split]
    even, odd = (np.repeat(plane, 3, axis=-1).astype(np.float32) for plane in grey)
    return Evidence(2, ((even + odd) / 2).astype(np.float32), (Half(even, 1), Half(odd, 1)), metric)
