"""The rules that compare with earlier images, told through images whose counts are known."""

import numpy as np
import pytest

from plateau.metric import Evidence
from plateau.metric.rules.multiple import Multiple
from plateau.metric.rules.myszkowski import Myszkowski
from plateau.metric.rules.reverse import Reverse
from plateau.metric.rules.successive import Successive
from tests.metric.rules.test_reverse import METRIC, SIDE, image_with, told


def stops(verdicts):
    return [verdict.stop for verdict in verdicts]


def test_by_successive_one_pixel_never_holds_up_an_image():
    assert stops(told(Successive(threshold=0.0), [5, 6])) == [False, True]


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
