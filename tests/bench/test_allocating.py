"""Jobs by zones, replayed from noise whose truth is known."""

import numpy as np
import pytest

from bench import allocation
from bench.support.film import Film
from bench.support.truth import Truth
from plateau.metric.compiled import CompiledVisibleDifferences
from tests.support.images import PAPER

SPP = 25


@pytest.fixture(scope="module")
def recording() -> np.ndarray:
    """240 slices of a grey film with a noisy corner."""
    sigma = np.full((48, 48, 1), 0.01, np.float32)
    sigma[:16, :16] = 0.05
    noise = np.random.default_rng(1).standard_normal((240, 48, 48, 3), np.float32)
    return np.float32(0.4) + noise * sigma


def test_a_film_has_the_samples_that_each_pixel_got(recording):
    film = Film(recording, SPP, np.arange(len(recording)))
    everywhere = np.ones((48, 48), bool)
    corner = np.zeros_like(everywhere)
    corner[:16, :16] = True
    film.add(everywhere, 100)
    film.add(corner, 200)
    assert film.mean_spp == pytest.approx(100 + 200 / 9)
    image = film.evidence(CompiledVisibleDifferences(PAPER)).image
    assert image[0, 0] == pytest.approx(recording[:12, 0, 0].mean(axis=0), abs=1e-6)
    assert image[40, 40] == pytest.approx(recording[:4, 40, 40].mean(axis=0), abs=1e-6)
    film.add(corner, 10_000)
    assert film.exhausted


def test_zones_end_sooner_than_frames(recording):
    truth = Truth(CompiledVisibleDifferences(PAPER), recording, SPP)
    found = allocation.measured(truth, runs=1)
    frames, zones = found[allocation.FRAMES], found["zones, 16 px"]
    assert zones[allocation.SPP] < 0.8 * frames[allocation.SPP]
    cells = allocation.cells(found)
    assert cells[allocation.FRAMES].startswith("1.00, 1.00, ")
