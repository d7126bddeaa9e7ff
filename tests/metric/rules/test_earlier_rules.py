"""The rules that compare with earlier images, told through images whose counts are known."""

import numpy as np
import pytest

from plateau.metric import Evidence, VisibleDifferences
from plateau.metric.rules.multiple import Multiple
from plateau.metric.rules.myszkowski import Myszkowski
from plateau.metric.rules.reverse import Reverse
from plateau.metric.rules.successive import Successive
from tests.support.images import PAPER

METRIC = VisibleDifferences(PAPER)
SIDE = 32


def image_with(visible_pixels):
    """A white image in which so many pixels are black: it differs from a white one in those."""
    image = np.ones((SIDE * SIDE, 3), np.float32)
    image[:visible_pixels] = 0
    return image.reshape(SIDE, SIDE, 3)


def told(rule, counts, *, step=100, start=0):
    """Judge one image for each count; two images differ visibly by the difference of theirs."""
    return [
        rule.judge(Evidence((start + i + 1) * step, image_with(count), None, METRIC))
        for i, count in enumerate(counts)
    ]


def values(verdicts):
    return [verdict.value for verdict in verdicts]


def stops(verdicts):
    return [verdict.stop for verdict in verdicts]


CURVE = [500, 200, 100, 60, 40, 30, 25, 22, 20, 20, 20, 20, 20, 20]


class TestSuccessive:
    def test_it_counts_what_changed_since_the_image_before(self):
        verdicts = told(Successive(), CURVE[:6])
        assert values(verdicts) == [None, 300, 100, 40, 20, 10]
        assert not any(stops(verdicts))

    def test_it_stops_at_the_first_image_that_looks_like_the_one_before(self):
        assert stops(told(Successive(), CURVE)).index(True) == 9
        threshold = 5 * 512**2 / SIDE**2  # five pixels of an image this small
        assert stops(told(Successive(threshold=threshold), CURVE)).index(True) == 6

    def test_one_pixel_never_holds_up_an_image(self):
        assert stops(told(Successive(threshold=0.0), [5, 6])) == [False, True]


class TestMultiple:
    def test_it_wants_a_whole_window_alike(self):
        verdicts = told(Multiple(window=3), CURVE)
        assert values(verdicts)[:4] == [None, None, None, 440]
        # The image of 20 pixels is seen at 9; three of them lie before the one at 12
        assert stops(verdicts).index(True) == 11
        assert "any of the last 3 images" in verdicts[11].reason

    def test_a_jump_back_within_the_window_is_seen(self):
        assert not any(stops(told(Multiple(window=3), [20, 300, 20, 20])))


class TestMyszkowski:
    def test_it_compares_with_the_image_of_half_the_samples(self):
        verdicts = told(Myszkowski(), CURVE[:8])
        compared = [verdict.numbers["compared_spp"] for verdict in verdicts]
        assert compared == [None, 100, 100, 200, 200, 300, 300, 400]
        assert values(verdicts)[3] == 200 - 60


RULES = [
    lambda: Successive(),
    lambda: Multiple(window=3),
    lambda: Multiple(window=1),
    lambda: Myszkowski(),
    lambda: Myszkowski(alpha=0.3),
    lambda: Reverse(),
]


@pytest.mark.parametrize("make", RULES)
def test_the_curve_only_goes_on_and_keeps_its_size(make):
    rule = make()
    told(rule, [5, 5])
    with pytest.raises(ValueError, match="100"):
        rule.judge(Evidence(100, image_with(5), None, METRIC))
    with pytest.raises(ValueError, match="pixels"):
        rule.judge(Evidence(300, np.ones((4, 4, 3), np.float32), None, METRIC))


@pytest.mark.parametrize("make", RULES)
def test_what_will_never_be_finite_holds_up_nothing(make):
    def with_nan(count):
        image = image_with(count)
        image[-1, -1] = np.nan
        return image

    rule = make()
    verdicts = [rule.judge(Evidence(100 * (i + 1), with_nan(20), None, METRIC)) for i in range(8)]
    assert verdicts[-1].stop
    assert verdicts[-1].numbers["non_finite_pixels"] == 1


@pytest.mark.parametrize("make", RULES)
def test_darkness_is_named(make):
    noise = np.random.default_rng(5).exponential(1e-5, (8, SIDE, SIDE, 3)).astype(np.float32)
    rule = make()
    verdicts = [
        rule.judge(Evidence(100 * (i + 1), one, None, METRIC)) for i, one in enumerate(noise)
    ]
    assert verdicts[-1].stop
    assert "dark" in verdicts[-1].reason
