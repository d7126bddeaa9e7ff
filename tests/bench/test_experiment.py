"""What the paper's experiment makes of what was rendered: truth, stops and tables."""

import pytest

from bench.experiment import tables
from bench.experiment.series import Curve, Measured
from bench.experiment.truth import converged_spp, reference_spp, true_spp, truth_at


def measured(truth: list[int], *, pixels: int = 100, stop: int | None = None) -> Measured:
    """A series of points 50 spp apart, with one contender."""
    spp = [50 * number for number in range(1, len(truth) + 1)]
    curves = {"rule @50": Curve(spp, [None] * len(spp), [None] * len(spp), stop)}
    return Measured("BOX 1", pixels, 10_000, spp, truth, [None] * len(spp), curves=curves)


class TestAgainstTheReference:
    def test_an_image_is_converged_where_it_falls_under_the_target_for_good(self) -> None:
        assert reference_spp(measured([90, 9, 11, 10, 2]), 0.001) == 200

    def test_it_is_from_the_first_on_where_it_was_never_above(self) -> None:
        assert reference_spp(measured([3, 2, 1]), 0.001) == 50

    def test_it_is_unknown_when_where_it_ends_above(self) -> None:
        assert reference_spp(measured([90, 5, 11]), 0.001) is None
        assert true_spp(measured([90, 5, 11]), 0.001) is None

    def test_one_pixel_is_allowed_whatever_the_target(self) -> None:
        assert reference_spp(measured([5, 1, 1]), 0.0000001) == 100


class TestTheReferencesOwnNoise:
    def test_makes_an_image_look_as_if_it_had_fewer_samples(self) -> None:
        assert converged_spp(10_000, 10_000) == 5000
        assert true_spp(measured([90, 9]), 0.001) == converged_spp(100, 10_000)

    def test_is_taken_out_of_the_truth(self) -> None:
        # At 100 spp against the truth as at 101.01 against the reference.
        one = measured([200, 100, 50])
        assert truth_at(one, converged_spp(100, 10_000)) == pytest.approx(100)

    def test_hides_what_lies_beyond_the_series(self) -> None:
        assert truth_at(measured([200, 100, 50]), 150) is None
        assert truth_at(measured([200, 100, 50]), 10_000) is None


class TestTables:
    def test_say_how_far_each_stop_is_from_the_true_one(self) -> None:
        one = measured([90, 30, 9, 8], stop=100)
        stop = tables.stops(one)["rule @50"]
        assert stop.spp == 100
        assert stop.error == pytest.approx(100 / converged_spp(150, 10_000) - 1)
        assert stop.wrong == pytest.approx(0.003, rel=0.05)
        assert stop.saved == pytest.approx(0.99)
        assert "| BOX 1 | 148 | 100 (-32%) |" in tables.stop_table([one], 50)

    def test_say_so_where_a_rule_never_stopped(self) -> None:
        one = measured([90, 30, 9, 8])
        assert "| 148 | over 10,000 |" in tables.stop_table([one], 50)
        assert "| rule @ 50 | – | – | 0 of 0 | 0 | 1 | 0% |" in tables.summary_table([one])
