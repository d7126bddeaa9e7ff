"""More noise is never less visible, on average: whatever masks, it masks less than it adds."""

import numpy as np
import pytest

from plateau.metric import VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.worker.renderers.analytic.picture import LIGHTS, NOISES
from tests.support.images import PAPER

SIZE, SEEDS = 48, 6
#: Standard deviation of the noise as a share of the light, from hardly visible to plain.
LEVELS = [0.01 * 2**n for n in range(6)]


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
@pytest.mark.parametrize("noise", ["gaussian", "heavy-tailed", "filtered"])
@pytest.mark.parametrize("scene", LIGHTS)
def test_more_noise_is_not_less_visible(scene, noise, predictor):
    metric, light = predictor(PAPER), LIGHTS[scene](SIZE, SIZE)
    reference = metric.percept(light)
    counts = []
    for level in LEVELS:
        found = []
        for seed in range(SEEDS):
            drawn = NOISES[noise](np.random.default_rng(seed), light.shape, 16)
            test = metric.percept(light * (1 + level * np.sqrt(16) * drawn))
            found.append(metric.compare(reference, test).count)
        counts.append(np.mean(found))
    assert counts == sorted(counts)
    assert counts[0] < 0.01 * SIZE**2 < 0.25 * SIZE**2 < counts[-1]
