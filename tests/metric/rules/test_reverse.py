"""The reverse comparison on curves made of real images.

A white image in which k pixels turn black differs visibly from the white one in those k pixels and
no others, so any curve can be told as a story of images.
"""

import numpy as np
import pytest

from plateau.metric import Evidence, Memory, View, VisibleDifferences
from plateau.metric.rules.line import least_squares_slope
from plateau.metric.rules.reverse import Reverse

METRIC = VisibleDifferences(View())
SIDE = 64
#: Where ε = 0.1 visible pixels per spp at SIDE × SIDE.
EPSILON = 0.1 * (512 / SIDE) ** 2


def image_with(visible_pixels, side=SIDE):
    image = np.ones((side * side, 3), np.float32)
    image[:visible_pixels] = 0
    return image.reshape(side, side, 3)


def told(rule, curve, *, step=100, start=0, side=SIDE):
    """Judge one image for each count of the curve; the first is the reference."""
    return [
        rule.judge(Evidence((start + i + 1) * step, image_with(count, side), None, METRIC))
        for i, count in enumerate(curve)
    ]


def stop_index(verdicts):
    return next((i for i, verdict in enumerate(verdicts) if verdict.stop), None)


class TestTheCurve:
    def test_its_points_are_the_visible_pixels_against_the_first_image(self):
        counts = [0, 1, 17, 400, 4096, 5]
        verdicts = told(Reverse(), counts)
        assert [verdict.numbers["visible_pixels"] for verdict in verdicts] == counts
        assert verdicts[3].numbers["visible_fraction"] == 400 / SIDE**2

    def test_the_first_image_is_no_point_of_it(self):
        # Given a window of three, the line needs three images after the first.
        verdicts = told(Reverse(window=3), [0, 90, 90, 90])
        assert [verdict.value for verdict in verdicts] == [None, None, None, 0.0]
        assert [verdict.stop for verdict in verdicts] == [False, False, False, True]

    def test_its_slope_is_the_least_squares_one_over_the_last_points(self):
        counts = [0, 300, 520, 610, 700, 690, 745, 760, 758]
        verdicts = told(Reverse(window=5), counts)
        spp = 100 * np.arange(1, len(counts) + 1)
        for i in range(5, len(counts)):
            expected = np.polyfit(spp[i - 4 : i + 1], counts[i - 4 : i + 1], 1)[0]
            assert verdicts[i].value == pytest.approx(expected, rel=1e-9)
            assert verdicts[i].numbers["slope"] == verdicts[i].value

    def test_its_spp_need_not_be_evenly_spaced(self):
        points = [(100, 10), (150, 30), (400, 80)]
        expected = np.polyfit(*np.transpose(points), 1)[0]
        assert least_squares_slope(points) == pytest.approx(expected, rel=1e-12)


class TestStopping:
    def test_a_plateau_stops(self):
        verdicts = told(Reverse(epsilon=EPSILON), [0, 800, 900, 901, 900, 902, 901, 900])
        assert stop_index(verdicts) == 6
        assert verdicts[6].value < 0.1

    @pytest.mark.parametrize("side", [16, 32, 64])
    def test_epsilon_scales_with_the_pixel_count(self, side):
        # Given the same share of the pixels visible at each spp, I expect the same stop.
        shares = [0, 32, 60, 66, 68, 69, 70, 70, 70, 70, 70, 70]
        counts = [share * side**2 // 256 for share in shares]
        verdicts = told(Reverse(epsilon=5.0), counts, side=side)
        assert verdicts[0].numbers["epsilon"] == 5.0 * side**2 / 512**2
        assert stop_index(verdicts) == 9


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

    def test_an_image_too_dark_to_see_anything_stops_and_says_so(self):
        generator = np.random.default_rng(5)
        rule = Reverse()
        for i in range(1, 7):
            noisy = generator.exponential(1e-5, (SIDE, SIDE, 3)).astype(np.float32)
            verdict = rule.judge(Evidence(100 * i, noisy, None, METRIC))
        assert verdict.stop
        assert verdict.value == 0
        assert "slope 0: the image is so dark (at most 0.001" in verdict.reason
        assert "cd/m²) that its noise cannot be seen" in verdict.reason

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


class TestOrder:
    @pytest.mark.parametrize("spp", [100, 200])
    def test_an_evaluation_that_goes_back_is_refused(self, spp):
        rule = Reverse()
        told(rule, [0, 10])
        with pytest.raises(ValueError, match="came after 200 spp"):
            rule.judge(Evidence(spp, image_with(20), None, METRIC))

    def test_an_image_of_another_size_is_refused(self):
        rule = Reverse()
        told(rule, [0])
        with pytest.raises(ValueError, match="64×64 and 32×32"):
            rule.judge(Evidence(200, image_with(0, 32), None, METRIC))

    def test_the_first_image_is_kept_though_the_monitor_goes_on_with_its_own(self):
        buffer = image_with(0)
        rule = Reverse()
        rule.judge(Evidence(100, buffer, None, METRIC))
        buffer[:] = 0
        assert rule.memory().images["first"].min() == 1


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
        "numbers",
        [
            {"first_spp": 100},
            {"first_spp": "100", "points": []},
            {"first_spp": 100, "points": [[200]]},
            {"first_spp": 100, "points": [[200, "1"]]},
        ],
    )
    def test_what_is_no_such_memory_is_refused(self, numbers):
        with pytest.raises(ValueError, match="not a memory of the rule 'reverse'"):
            Reverse(window=5).recall(Memory(numbers, {"first": image_with(0)}))

    def test_a_memory_without_its_image_is_refused(self):
        with pytest.raises(ValueError, match="not a memory of the rule 'reverse'"):
            Reverse().recall(Memory({"first_spp": 100, "points": []}))
