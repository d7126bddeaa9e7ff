"""The rule `visible` and its forecast, on noise of which the truth is known."""

import numpy as np
import pytest

from plateau.metric import Evidence, Half, Visible, VisibleDifferences
from tests.support.images import PAPER

METRIC = VisibleDifferences(PAPER)
SIDE = 64
GREY = 0.4
SIGMA = 0.6  #: standard deviation of one sample


def evidence(spp, seed=1, sigma=SIGMA):
    """A flat grey whose noise falls as 1/sqrt(spp), in two halves."""
    spp -= spp % 2
    noise = np.random.default_rng(seed).normal(0, 1, (2, SIDE, SIDE, 3))
    even, odd = (np.float32(GREY + n * sigma / np.sqrt(spp / 2)) for n in noise)
    return Evidence(spp, (even + odd) / 2, (Half(even, spp // 2), Half(odd, spp // 2)), METRIC)


NOISY, CLEAN = 200, 40_000


def verdicts(*seen):
    rule = Visible(min_spp=1)
    return [rule.judge(one) for one in seen]


def test_while_there_are_two_evaluations_both_have_to_pass():
    assert not verdicts(evidence(CLEAN))[-1].stop
    assert verdicts(evidence(CLEAN), evidence(CLEAN + 100))[-1].stop
    assert not verdicts(evidence(NOISY), evidence(CLEAN))[-1].stop


def test_from_three_on_it_stops_as_soon_as_the_estimate_and_its_trend_are_there():
    spps = [round(1000 * 1.3**k) for k in range(15)]
    story = verdicts(*map(evidence, spps))
    allowed = story[0].numbers["allowed_pixels"]
    reached = [verdict.numbers["estimate_pixels"] <= allowed for verdict in story]
    stops = [verdict.stop for verdict in story]
    assert 3 <= stops.index(True) <= reached.index(True) + 1
    assert all(seen for seen, stop in zip(reached, stops, strict=True) if stop)


def test_a_lucky_look_does_not_stop_it():
    lucky = evidence(500, sigma=0.0)
    last = verdicts(evidence(300), evidence(400), lucky)[-1]
    assert not last.stop
    assert last.numbers["estimate_pixels"] == 0 < last.numbers["trend_pixels"]
    assert "reached now, but not yet by the trend" in last.reason


def test_nor_does_a_lucky_trend():
    # A steep fall promises more than the image holds.
    last = verdicts(evidence(300), evidence(450, sigma=0.15), evidence(500, sigma=0.2))[-1]
    assert last.numbers["trend_pixels"] < last.numbers["estimate_pixels"]
    assert not last.stop


def test_it_waits_for_its_minimum_of_samples():
    rule = Visible(min_spp=600)
    stops = [rule.judge(evidence(spp, sigma=0.0)).stop for spp in (200, 400, 600, 800)]
    assert stops == [False, False, True, True]


@pytest.mark.parametrize("side", [1, 4, 16, 64])
@pytest.mark.parametrize("target", [0.0002, 0.5, 0.99])
def test_no_image_ends_whose_pixels_all_differ_or_more_than_the_fraction_asked_for(side, target):
    noise = np.random.default_rng(1).normal(0, 1, (2, side, side, 3))
    seen = [
        Evidence(spp, noise[0], tuple(Half(np.float32(GREY + n), spp // 2) for n in noise), METRIC)
        for spp in (400, 800, 1600)
    ]
    last = [verdict for rule in [Visible(target=target)] for verdict in map(rule.judge, seen)][-1]
    assert last.numbers["allowed_pixels"] == pytest.approx(target * side**2)
    assert last.stop == (last.numbers["estimate_pixels"] <= target * side**2)
    assert last.numbers["estimate_pixels"] < side**2 or not last.stop
    assert side > 1 or not last.stop
    assert ("none, at this size" in last.reason) == (target * side**2 < 0.5)


def test_a_small_image_ends_once_no_pixel_differs():
    grey = np.full((4, 4, 3), GREY, np.float32)
    seen = [Evidence(spp, grey, (Half(grey, spp // 2),) * 2, METRIC) for spp in (400, 800)]
    rule = Visible()
    assert [rule.judge(one).stop for one in seen] == [False, True]


def test_without_halves_it_waits():
    grey = np.full((8, 8, 3), GREY, np.float32)
    verdict = Visible().judge(Evidence(1000, grey, None, METRIC))
    assert (verdict.stop, verdict.value) == (False, None)
    assert "two halves" in verdict.reason


def test_its_trend_is_of_the_evaluations_since_half_the_samples():
    rule = Visible(min_spp=1)
    for spp in range(100, 1100, 100):
        rule.judge(evidence(spp))
    assert [spp for spp, _ in rule.memory().numbers["points"]] == [500, 600, 700, 800, 900, 1000]


class TestForecast:
    def test_the_estimate_has_fallen_to_the_target_where_it_says(self):
        # Given noise whose law is known, forecast from four times as noisy an image
        target, now = 0.02, 1600
        spps = [evidence(now, seed).forecast(target) for seed in range(20)]
        # Then so much is left there, in the mean of twenty tries: 1.01, of a deviation of 0.03
        left = [evidence(spp, 100 + seed).estimate.fraction for seed, spp in enumerate(spps)]
        assert min(spps) > now
        assert abs(np.mean(left) / target - 1) < 0.15

    def test_what_is_reached_is_reached_now(self):
        assert evidence(CLEAN).forecast(0.01) == CLEAN

    def test_a_lower_target_takes_longer(self):
        seen = evidence(1600)
        spps = [seen.forecast(t) for t in (0.1, 0.03, 0.01)]
        assert spps == sorted(spps)

    def test_out_of_reach_is_said(self):
        seen = evidence(2, sigma=1000.0)
        assert seen.forecast(1e-3) is None
