"""A logistic fit to single answers: known thresholds come back, with intervals that hold."""

import numpy as np
import pytest

from plateau.study.answers import AnswersFit, fit_answers

LEVELS = (100.0, 500.0, 900.0, 1300.0, 1700.0, 2100.0, 2500.0)
THRESHOLD, SPREAD = 1400.0, 300.0


def simulated(seed: int, observers: int = 6, between: float = 0.0) -> AnswersFit:
    """A fit to observers of whom each sees every level twice.

    Their own thresholds are spread with a standard deviation of `between`.
    """
    rng = np.random.default_rng(seed)
    spp = np.tile(LEVELS, 2 * observers)
    who = np.repeat(np.arange(observers), 2 * len(LEVELS))
    own = THRESHOLD + between * rng.standard_normal(observers)
    seen = rng.random(spp.size) < 1 / (1 + np.exp((spp - own[who]) / SPREAD))
    return fit_answers(spp.tolist(), seen.tolist(), [f"o-{one}" for one in who])


def holds(fit: AnswersFit) -> bool:
    interval = fit.interval(0.5)
    assert interval is not None
    low, high = interval
    assert low < fit.threshold(0.5) < high
    return low <= THRESHOLD <= high


def test_an_interval_of_95_percent_holds_the_truth_as_often() -> None:
    # Seeds 0 … 199. If 95 % hold it, 181 of them or fewer would in 0.6 % of such runs.
    assert sum(holds(simulated(seed)) for seed in range(200)) > 181


def test_observers_who_differ_widen_it() -> None:
    # Seeds 0 … 99. As if all answers were independent, two thirds of the intervals would hold it.
    fits = [simulated(seed, observers=20, between=600) for seed in range(100)]
    alone = [
        AnswersFit(fit.a, fit.b, fit.answers, fit.observers, fit.covariances[:1]) for fit in fits
    ]
    assert sum(map(holds, fits)) > 85 > sum(map(holds, alone))


def test_answers_that_change_at_one_level_have_a_finite_fit() -> None:
    spp = [100, 200, 300, 400] * 6
    fit = fit_answers(spp, [True, True, False, False] * 6, ["a"] * 12 + ["b"] * 12)
    assert fit.threshold(0.5) == pytest.approx(250)
    low, high = fit.interval(0.5) or (0, 0)
    assert 150 < low < 200 < 300 < high < 350


@pytest.mark.parametrize("seen", [[True] * 8, [True, False] * 4, [False] * 8])
def test_answers_that_do_not_depend_on_spp_bound_nothing(seen: list[bool]) -> None:
    fit = fit_answers([100, 100, 200, 200] * 2, seen, ["a"] * 4 + ["b"] * 4)
    assert fit.interval(0.5) is None


@pytest.mark.parametrize(
    ("spp", "seen", "observers", "words"),
    [
        ([100, 100], [True, False], ["a", "a"], "two different spp"),
        ([100, float("nan")], [True, False], ["a", "a"], "two different spp"),
        ([], [], [], "two different spp"),
        ([100, 200], [True], ["a", "a"], "for each answer"),
    ],
)
def test_what_cannot_be_fitted_is_said(
    spp: list[float], seen: list[bool], observers: list[str], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        fit_answers(spp, seen, observers)


@pytest.mark.parametrize("probability", [0.0, 1.0, -0.1, float("nan")])
def test_a_probability_is_between_0_and_1(probability: float) -> None:
    with pytest.raises(ValueError, match="above 0 and below c = 1"):
        simulated(0).threshold(probability)
