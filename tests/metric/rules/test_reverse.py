"""The reverse comparison on curves made of real images.

A white image in which k pixels turn black differs visibly from the white one in those k pixels and
no others, so any curve can be told as a story of images.
"""

import numpy as np
import pytest

from plateau.metric import Evidence, VisibleDifferences
from plateau.metric.rules.base import Memory
from plateau.metric.rules.reverse import Reverse
from tests.support.images import PAPER

METRIC = VisibleDifferences(PAPER)
SIDE = 64
#: Where ε = 0.1 visible pixels per spp at SIDE × SIDE.
EPSILON = 0.1 * (512 / SIDE) ** 2


def image_with(visible_pixels, side=SIDE):
    image = np.ones((side * side, 3), np.float32)
    image[:visible_pixels] = 0
    return image.reshape(side, side, 3)


def told(rule, curve, side=SIDE):
    """Judge one image for each count of the curve; the first is the reference."""
    return [
        rule.judge(Evidence((i + 1) * 100, image_with(count, side), None, METRIC))
        for i, count in enumerate(curve)
    ]


class TestTheCurve:
    def test_its_points_are_the_visible_pixels_against_the_first_image(self):
        counts = [0, 1, 17, 400, 4096, 5]
        verdicts = told(Reverse(), counts)
        assert [verdict.numbers["visible_pixels"] for verdict in verdicts] == counts
        assert verdicts[3].numbers["visible_fraction"] == 400 / SIDE**2

    def test_its_slope_is_the_least_squares_one_over_the_last_points(self):
        counts = [0, 300, 520, 610, 700, 690, 745, 760, 758]
        verdicts = told(Reverse(window=5), counts)
        spp = 100 * np.arange(1, len(counts) + 1)
        for i in range(5, len(counts)):
            expected = np.polyfit(spp[i - 4 : i + 1], counts[i - 4 : i + 1], 1)[0]
            assert verdicts[i].value == pytest.approx(expected, rel=1e-9)
            assert verdicts[i].numbers["slope"] == verdicts[i].value


@pytest.mark.parametrize("side", [16, 32, 64])
def test_epsilon_scales_with_the_pixel_count(side):
    # Given the same share of the pixels visible at each spp, I expect the same stop.
    shares = [0, 32, 60, 66, 68, 69, 70, 70, 70, 70, 70, 70]
    counts = [share * side**2 // 256 for share in shares]
    verdicts = told(Reverse(epsilon=5.0), counts, side=side)
    assert verdicts[0].numbers["epsilon"] == 5.0 * side**2 / 512**2
    assert next((i for i, verdict in enumerate(verdicts) if verdict.stop), None) == 9


class TestReasons:
    def test_each_verdict_says_where_the_curve_is(self):
        verdicts = told(Reverse(epsilon=EPSILON, window=3), [0, 600, 700, 800, 801, 801])
        unit = "changed pixels per spp over the last 3 points"
        assert [verdict.reason for verdict in verdicts] == [
            "the image at 100 spp is the first, against which others are seen",
            "the curve has 1 of the 3 points of a slope",
            "the curve has 2 of the 3 points of a slope",
            f"the curve still climbs: slope 1 {unit}, above ε = 0.1",
            f"the curve still climbs: slope 0.505 {unit}, above ε = 0.1",
            f"the curve has levelled off: slope 0.005 {unit}, at most ε = 0.1",
        ]

    def test_a_bright_image_without_noise_is_not_called_dark(self):
        verdict = told(Reverse(), [0] * 6)[-1]
        assert verdict.stop
        assert verdict.reason == (
            "nothing has changed visibly since the image at 100 spp on any of the last 5 points, "
            "slope 0: the first image already looked like the present one"
        )

    def test_pixels_that_are_not_finite_are_left_out_and_counted_apart(self):
        rule = Reverse()
        for spp, visible in ((100, 0), (200, 20)):
            bad = image_with(visible)
            bad[-1, -1] = np.nan
            verdict = rule.judge(Evidence(spp, bad, None, METRIC))
            assert verdict.numbers["non_finite_pixels"] == 1
            assert verdict.numbers["visible_pixels"] == visible
            assert np.count_nonzero(verdict.visible) == visible


class TestMemory:
    def test_it_holds_one_image_and_the_last_points(self):
        rule = Reverse(window=3)
        told(rule, [0, 10, 20, 30, 40])
        memory = rule.memory()
        assert memory.numbers == {"first_spp": 100, "points": [[300, 20], [400, 30], [500, 40]]}
        assert list(memory.images) == ["first"]
        assert np.array_equal(memory.images["first"], image_with(0))

    def test_of_a_longer_window_it_takes_the_last_points(self):
        longer, shorter = Reverse(window=5), Reverse(window=2)
        told(longer, [0, 10, 20, 30, 40])
        shorter.recall(longer.memory())
        assert shorter.memory().numbers["points"] == [[400, 30], [500, 40]]

    @pytest.mark.parametrize(
        ("numbers", "images"),
        [
            ({"first_spp": 100}, {"first": image_with(0)}),
            ({"first_spp": "100", "points": []}, {"first": image_with(0)}),
            ({"first_spp": 100, "points": [[200]]}, {"first": image_with(0)}),
            ({"first_spp": 100, "points": [[200, "1"]]}, {"first": image_with(0)}),
            ({"first_spp": 100, "points": []}, {}),
        ],
    )
    def test_what_is_no_such_memory_is_refused(self, numbers, images):
        with pytest.raises(ValueError, match="not a memory of the rule 'reverse'"):
            Reverse(window=5).recall(Memory(numbers, images))
