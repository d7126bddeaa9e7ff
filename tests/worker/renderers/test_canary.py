"""The known image: every renderer makes it, with the same bits each time, and errors are seen."""

from typing import Any

import numpy as np
import pytest

from plateau.worker.renderers.canary import Canary, CanaryWrong
from plateau.worker.supervisor.variants import probe
from tests.support.variants import VARIANTS, known_probe, library_for

SEED, SPP = 3, 64


@pytest.fixture
def canary() -> Canary:
    """A film of a flat grey, with the noise of 64 spp."""
    truth = np.full((16, 24, 3), 0.35)
    noise = np.random.default_rng(SEED).normal(0, 0.3 / np.sqrt(SPP), truth.shape)
    film = np.full((16, 24, 4), SPP, np.float32)
    film[..., :3] = SPP * (truth + noise)
    return Canary(film=film, truth=truth, spp=SPP)


def test_a_film_of_the_known_image_is_one(canary: Canary) -> None:
    # Of 18 means with a standard error of 0.005 none is 0.05 off: false alarms are below 1e-20
    canary.check()


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (np.s_[8:, 16:, 1], 0.28 * SPP, "in 17% of its blocks: G is 0.28 where 0.35 is right"),
        (np.s_[3, 5, 2], np.nan, "in 17% of its blocks: B is nan where 0.35 is right"),
        (np.s_[:, :, :3], 0, "in 100% of its blocks: R is 0 where 0.35 is right"),
        (np.s_[2, 2, 3], SPP - 1, "other filter weights than it should"),
    ],
)
def test_another_film_is_refused_in_words(
    canary: Canary, place: Any, value: float, words: str
) -> None:
    whole = canary.bits
    canary.film[place] = value
    assert canary.bits != whole
    with pytest.raises(CanaryWrong, match=words):
        canary.check()


@pytest.mark.parametrize("variant", [*VARIANTS, "analytic:numpy", "scalar_spectral"])
def test_every_process_makes_it_with_the_same_bits(variant: str) -> None:
    first, again = (trial(variant, library_for(variant)) for trial in (known_probe, probe))
    assert first.ok, first.detail
    assert first.detail == f"rendered a known image, bits {first.bits}"
    assert first.bits
    assert again == first
