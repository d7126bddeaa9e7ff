"""The rules of a stated error; whether that is the true one, tests/statistical judges."""

import numpy as np
import pytest

from plateau.metric import Evidence, View, VisibleDifferences, create_rule
from plateau.metric.standard_error import Quarters, plain, squared_error

METRIC = VisibleDifferences(View())
GREY = np.full((32, 32, 3), 0.4, np.float32)
ERRORS = ["relmse", "rmse", "psnr", "noise"]


def evidence(spp, sigma=0.5, change=None):
    """A grey with so much noise in a sample, in four quarters that may be changed."""
    noise = np.random.default_rng(4).normal(0, sigma / (spp / 4) ** 0.5, (4, *GREY.shape))
    means = list((GREY + noise).astype(np.float32))
    if change is not None:
        change(means)
    image = np.mean(means, axis=0, dtype=np.float32)
    return Evidence(spp, image, None, METRIC, quarters=Quarters(means, [spp // 4] * 4, lambda x: x))


def verdict(name, seen, **parameters):
    return create_rule(name, **parameters).judge(seen)


@pytest.mark.parametrize("name", ERRORS)
def test_it_goes_on_until_the_error_is_surely_reached_and_says_when_that_will_be(name):
    rule = create_rule(name, target=verdict(name, evidence(4000)).value, min_spp=1)
    assert not rule.judge(evidence(400)).stop
    expected = rule.expected_end_spp(None)
    assert 4000 < expected < 5000
    assert not rule.judge(evidence(4000)).stop  # as likely above as below
    assert rule.judge(evidence(round(1.15 * expected))).stop
    assert rule.expected_end_spp(None) == round(1.15 * expected)


def test_what_is_sure_does_not_depend_on_the_samples_that_report():
    def change(means):  # the difference of the even slices, and of the odd ones
        more = np.random.default_rng(6).normal(0, 0.1, GREY.shape)
        for one, other in ((0, 2), (1, 3)):
            means[one] += more
            means[other] -= more

    before, after = (
        squared_error(evidence(400, change=one).quarters, plain).tiles for one in (None, change)
    )
    assert after[0].mean() > 2 * before[0].mean()
    assert after[2].mean() == pytest.approx(before[2].mean(), rel=0.1)


@pytest.mark.parametrize("lit", [1, 2])
def test_an_estimate_below_zero_is_not_no_error(lit):
    def change(means):  # a firefly, and black quarters beside it, whose weights are below zero
        for index, value in {0: 1000, 1: 0, 2: 0, 3: 0, lit: 0.8}.items():
            means[index][5, 6] = value

    seen = verdict("relmse", evidence(400, change=change), min_spp=1)
    assert min(seen.value, seen.numbers["sure"]) > 1
    assert not seen.stop


@pytest.mark.parametrize(
    ("name", "value"), [("rmse", 5.0), ("relmse", 25 / (0.4**2 + 0.01)), ("psnr", -20.0)]
)
def test_fireflies_are_an_error_and_are_named(name, value):
    def change(means):
        means[2][5, 6] += 4 * 5 * 32  # an RMSE of 5; on the display it is 0.33 at most

    seen = verdict(name, evidence(40_000, change=change))
    if name != "psnr":
        assert seen.value == pytest.approx(value, rel=0.02)
        assert seen.numbers["few_share"] > 0.99
    else:
        white = 1 - 0.665  # of which sRGB shows 0.4
        assert seen.value == pytest.approx(-20 * np.log10(white / 32), abs=1)
    assert "0.098 % of the pixels hold" in seen.reason
    assert "fireflies" in seen.reason


def test_above_white_noise_is_no_error_of_the_display():
    def change(means):
        for mean in means:
            mean += 3

    assert verdict("psnr", evidence(400, change=change)).value > 90
    assert verdict("psnr", evidence(400)).value < 40


def test_quarters_of_other_numbers_of_slices_are_weighed():
    seen = evidence(400)
    rng, slices = np.random.default_rng(5), [35, 5, 5, 5]
    means = [(GREY + rng.normal(0, 0.1 / n**0.5, GREY.shape)).astype(np.float32) for n in slices]
    seen = Evidence(400, GREY, None, METRIC, quarters=Quarters(means, slices, lambda x: x))
    assert verdict("rmse", seen).value == pytest.approx(0.1 / 50**0.5, rel=0.05)


@pytest.mark.parametrize("name", ERRORS)
def test_what_is_not_known_is_never_reached(name):
    def black(means):
        for mean in means:
            mean[:] = 0

    def broken(means):
        for mean in means:
            mean[:] = np.nan

    one = Evidence(100, GREY, None, METRIC)
    seen = {"four slices": one, "black": evidence(400, change=black)}
    seen["the image is black"] = evidence(400, change=broken)
    for words, what in seen.items():
        rule = create_rule(name, min_spp=1)
        said = rule.judge(what)
        assert (said.value, said.stop) == (None, False)
        assert words in said.reason
        assert rule.expected_end_spp(None) is None


def test_pixels_that_are_no_numbers_are_left_out_and_counted():
    def change(means):
        means[1][3, 4, 0] = np.nan
        means[2][7, 7] = np.inf

    whole, seen = (verdict("rmse", evidence(400, change=one)) for one in (None, change))
    assert seen.numbers["non_finite_pixels"] == 2
    assert "2 pixels that are NaN or infinite are left out" in seen.reason
    assert seen.value == pytest.approx(whole.value, rel=0.01)


def test_an_image_without_noise_has_no_error():
    for name in ERRORS:
        seen = verdict(name, evidence(400, sigma=0.0))
        assert seen.stop
        assert seen.value == (200 if name == "psnr" else 0)
