"""The quality by ColorVideoVDP and its rule `jod`, on noise of which the truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from plateau.metric import Evidence, Half, View, VisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP
from plateau.metric.display import displayed
from plateau.metric.noise_model import noise_model
from plateau.metric.quality import QualityModel, display_of
from plateau.metric.rules.jod import Jod
from tests.support.images import PAPER

SIDE = 64
SIGMA = 0.6  #: standard deviation of one sample
VIEW = PAPER
#: A grey that rises from left to right.
RAMP = np.broadcast_to(np.linspace(0.1, 0.8, SIDE, dtype=np.float32)[:, None], (SIDE, SIDE, 3))


def evidence(spp, *, view=VIEW, sigma=SIGMA, seed=1, truth=RAMP):
    """An image whose noise falls as 1/sqrt(spp), in two halves."""
    noise = np.random.default_rng(seed).normal(0, 1, (2, *truth.shape))
    even, odd = (np.float32(truth + n * sigma / np.sqrt(spp / 2)) for n in noise)
    halves = Half(even, spp // 2), Half(odd, spp // 2)
    return Evidence(spp, (even + odd) / 2, halves, VisibleDifferences(view))


def true_jod(seen, truth=RAMP):
    eye = ColorVideoVDP(display_of(seen.metric.view, SIDE))
    reference, test = (eye.percept(displayed(one, seen.metric.view)) for one in (truth, seen.image))
    return eye.compare(reference, test).jod


@pytest.mark.parametrize("view", [VIEW, View(field_of_view_deg=8)], ids=["near", "far"])
@pytest.mark.parametrize("spp", [100, 1600])
def test_it_says_what_the_converged_image_would(view, spp):
    seen = evidence(spp, view=view)
    lost, true = 10 - seen.quality.jod, 10 - true_jod(seen)
    assert true > 0.05
    assert 0.85 * true < lost < 1.25 * true
    assert seen.quality.low_jod < seen.quality.jod


def test_the_forecast_is_where_the_target_is_reached():
    target = 9.0
    assert true_jod(evidence(200)) < target - 0.5
    spp = 2 * round(evidence(200).quality_forecast(target) / 2)
    assert spp > 400
    assert true_jod(evidence(spp, seed=2)) == pytest.approx(target, abs=0.1)


def test_what_is_reached_is_forecast_for_now_and_what_is_out_of_reach_for_never():
    seen = evidence(1000)
    assert seen.quality_forecast(seen.quality.low_jod - 0.01) == 1000
    assert seen.quality_forecast(seen.quality.jod - 0.01) > 1000  # likely, and not sure
    assert evidence(2).quality_forecast(9.99) is None


def test_noise_is_seen_less_from_afar_and_in_a_lit_room():
    near = View(field_of_view_deg=8)
    at_hand = evidence(200, view=near).quality.jod
    for view in (View(field_of_view_deg=1.6), replace(near, ambient_lux=20_000)):
        assert evidence(200, view=view).quality.jod > at_hand + 0.1
    assert evidence(200, view=replace(near, contrast=2)).quality.jod > at_hand


@pytest.mark.parametrize(
    "view",
    [
        View(field_of_view_deg=0.0001),
        View(field_of_view_deg=179.9),
        View(exposure_ev=100),
        View(exposure_ev=-100),
        View(white_luminance=0.01, contrast=1e9, ambient_lux=0),
        View(white_luminance=20_000, ambient_lux=100_000),
        View(primaries="adobe1998"),
    ],
)
def test_any_view_has_a_quality(view):
    assert 0 < evidence(200, view=view).quality.jod <= 10


def test_a_pixel_that_is_no_number_counts_as_equal():
    seen = evidence(200)
    broken = seen.image.copy()
    broken[7, 8] = np.nan
    jod = Evidence(200, broken, seen.halves, seen.metric).quality.jod
    assert jod == pytest.approx(seen.quality.jod, abs=0.05)


def test_an_image_smaller_than_its_pyramid_has_none():
    small = evidence(200, truth=RAMP[:3, :3])
    assert small.quality is None
    assert small.quality_forecast(9.5) is None
    assert "too small" in Jod().judge(small).reason


def test_noise_without_an_image_behind_it_is_worse_the_more_there_is_of_it():
    seen = evidence(200)
    model = QualityModel(noise_model(seen.metric, seen.image, seen.halves), VIEW)
    qualities = [model.at(amount) for amount in (0.0, 0.25, 0.5, 1.0, 2.0)]
    assert qualities[0] == 10
    assert qualities == sorted(qualities, reverse=True)


NOISY, CLEAN = evidence(200), evidence(40_000)


def verdicts(*seen, target=9.0):
    rule = Jod(target=target, min_spp=1)
    return [rule.judge(one) for one in seen]


class TestTheRule:
    def test_stops_at_the_second_evaluation_that_passes(self):
        assert not verdicts(CLEAN)[-1].stop
        assert verdicts(CLEAN, evidence(40_100))[-1].stop

    def test_stops_as_soon_as_the_target_is_surely_reached(self):
        story = verdicts(*(evidence(spp) for spp in range(400, 2400, 200)))
        reached = [verdict.numbers["low_jod"] >= 9.0 for verdict in story]
        assert [verdict.stop for verdict in story] == reached
        assert reached.index(True) > 1

    def test_does_not_stop_for_a_lucky_look(self):
        last = verdicts(evidence(300), evidence(400), evidence(500, sigma=0.0))[-1]
        assert last.value == 10
        assert not last.stop
        assert "the evaluation before was too far from it" in last.reason

    def test_has_the_quality_as_its_value_and_stops_by_what_is_sure(self):
        verdict = verdicts(evidence(1000), target=evidence(1000).quality.jod)[0]
        assert verdict.value == evidence(1000).quality.jod
        assert verdict.numbers["low_jod"] < verdict.value
        assert "the target is" in verdict.reason

    def test_waits_for_its_least_spp(self):
        rule = Jod(target=5, min_spp=1000)
        stops = [rule.judge(evidence(spp)).stop for spp in (400, 800, 1000)]
        assert stops == [False, False, True]

    def test_expects_to_end_where_the_quality_is_forecast(self):
        rule = Jod(target=9.0, min_spp=1)
        assert rule.expected_end_spp(None) is None
        rule.judge(NOISY)
        assert rule.expected_end_spp(None) == NOISY.quality_forecast(9.0)

    def test_is_told_apart_from_an_image_of_one_slice(self):
        one = Evidence(100, NOISY.image, None, NOISY.metric)
        verdict = Jod().judge(one)
        assert verdict.value is None
        assert "no two halves" in verdict.reason


def test_an_image_without_any_light_is_never_good_enough():
    black, rule = np.zeros_like(RAMP), Jod()
    verdicts = [rule.judge(evidence(spp, sigma=0, truth=black)) for spp in (200, 400, 600)]
    assert not any(verdict.stop for verdict in verdicts)
    assert "the image is black" in verdicts[-1].reason
    # One without noise is, and its reason says what it cannot know
    still = [rule.judge(evidence(spp, sigma=0)) for spp in (800, 1000)][-1]
    assert (still.stop, "no sample differs" in still.reason) == (True, True)


def test_fireflies_in_a_single_place_hide_light_and_end_nothing():
    truth, place = RAMP.copy(), np.zeros((SIDE, SIDE, 1), np.float32)
    truth[:32, 32:] += 0.05
    place[:32:16, 32::16] = 0.05 * 16**2  # the same light, in four of its pixels

    def lit(spp, fireflies):
        calm = evidence(spp, sigma=0.1, view=View())
        even, odd = calm.halves
        even = Half(even.mean + 2 * np.float32(fireflies) * place, even.spp)
        return replace(calm, image=(even.mean + odd.mean) / 2, halves=(even, odd))

    for fireflies in (False, True):
        first, last = (lit(spp, fireflies) for spp in (2000, 2100))
        verdict = verdicts(first, last)[-1]
        assert verdict.stop != fireflies
        assert ("fireflies hide light" in verdict.reason) == fireflies
    assert true_jod(last, truth) < 9.0 < last.quality.jod
    assert last.quality.low_jod == pytest.approx(true_jod(last, truth), abs=0.05)
