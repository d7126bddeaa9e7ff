"""What the paper's experiment makes of what was rendered: truth, stops and tables."""

import pytest

from bench import paper
from bench.support.report import markdown
from bench.support.series import CONTENDERS, Series, Stop


def measured(truth: list[int], *, stop: int | None = None) -> Series:
    """A series of points 50 spp apart, in which each contender stopped there."""
    one = Series("BOX 1", 100, 10_000, truth)
    spp = 50 * len(truth) if stop is None else stop
    for name in CONTENDERS:
        one.stops[f"{name} @50"] = Stop(spp, stop is not None, 1, truth[spp // 50 - 1])
    return one


def converged(spp: float) -> float:
    """At how many spp an image is as far from the truth as at `spp` from the reference."""
    return 1 / (1 / spp + 1 / 10_000)


class TestAgainstTheReference:
    def test_an_image_is_converged_where_it_falls_under_the_target_for_good(self) -> None:
        assert measured([90, 9, 11, 10, 2]).reference_spp(0.001) == 200

    def test_it_is_from_the_first_on_where_it_was_never_above(self) -> None:
        assert measured([3, 2, 1]).reference_spp(0.001) == 50

    def test_it_is_unknown_when_where_it_ends_above(self) -> None:
        assert measured([90, 5, 11]).reference_spp(0.001) is None
        assert measured([90, 5, 11]).true_spp(0.001) is None

    def test_no_pixel_is_allowed_where_the_target_is_less_than_one(self) -> None:
        assert measured([5, 1, 0]).reference_spp(0.0000001) == 150


class TestTheReferencesOwnNoise:
    def test_makes_an_image_look_as_if_it_had_fewer_samples(self) -> None:
        assert converged(10_000) == 5000
        assert measured([90, 9]).true_spp(0.001) == converged(100)

    def test_is_taken_out_of_the_truth(self) -> None:
        # At 100 spp against the truth as at 101.01 against the reference.
        one = measured([200, 100, 50])
        assert one.truth_at(converged(100)) == pytest.approx(100)

    def test_hides_what_lies_beyond_the_series(self) -> None:
        assert measured([200, 100, 50]).truth_at(150) is None
        assert measured([200, 100, 50]).truth_at(10_000) is None


class TestTables:
    def test_say_how_far_each_stop_is_from_the_true_one(self) -> None:
        one = measured([90, 30, 9, 8], stop=100)
        off = paper.error(one, one.stops["reverse @50"])
        assert off == pytest.approx(100 / converged(150) - 1)
        assert "| BOX 1 | 148 | 100 (-32%) |" in markdown(paper.stop_table([one], 50))

    def test_say_so_where_a_rule_never_stopped(self) -> None:
        one = measured([90, 30, 9, 8])
        assert "| 148 | over 10,000 |" in markdown(paper.stop_table([one], 50))
        one.stops |= {f"{name} @100": one.stops[f"{name} @50"] for name in CONTENDERS}
        shown = markdown(paper.summary_table([one]))
        assert "| reverse @ 50 | – | – | 0 of 0 | 0 | 1 | 0% |" in shown
