"""The paper's experiment in small: the farm renders, every rule judges, tables and plots come."""

from pathlib import Path

import pytest

from bench import paper
from bench.experiment import tables
from bench.experiment.cases import cases
from bench.experiment.series import Curve, Measured
from bench.experiment.truth import converged_spp, reference_spp, true_spp, truth_at
from bench.support import report
from farm.spec import JobSpec, MultipleSpec, MyszkowskiSpec, ReverseSpec, SuccessiveSpec
from plateau.judge import find_series, judge_series
from tests.bench.conftest import SIZE


@pytest.fixture(scope="module")
def box_1(data: Path, results: Path) -> Measured:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "RESULTS", results)
        [measured] = paper.run(cases(("box",))[:1], SIZE, data, workers=1)
    return measured


class TestARun:
    def test_holds_every_image_against_a_reference_of_other_samples(self, box_1: Measured) -> None:
        assert box_1.spp == list(range(50, 601, 50))
        # Its own last image would be no different from itself.
        assert box_1.truth[0] > box_1.truth[-1] > 0

    def test_stops_where_plateau_judge_does(self, box_1: Measured, data: Path) -> None:
        spec = JobSpec(
            step=100,
            watch=(ReverseSpec(), MultipleSpec(window=5), SuccessiveSpec(), MyszkowskiSpec()),
        )
        slices = data / "box-1-24-600-series" / "slices"
        judged = judge_series(find_series(slices, image_spp=None, cumulative=False), spec)
        assert judged.stops == {
            "reverse": box_1.curves["reverse @100"].stop,
            "multiple": box_1.curves["multiple, window 5 @100"].stop,
            "successive": box_1.curves["successive @100"].stop,
            "myszkowski": box_1.curves["myszkowski @100"].stop,
            "visible": box_1.curves["visible @100"].stop,
        }
        assert [point.visible_pixels for point in judged.points] == box_1.curves[
            "reverse @100"
        ].visible

    def test_leaves_tables_pictures_and_curves(self, box_1: Measured, results: Path) -> None:
        left = {path.name for path in (results / "paper").iterdir()}
        assert left == {
            "box-1.json",
            *(f"{name}.png" for name in ("figure-4", "figure-5", "figure-6", "truth")),
        }
        assert Measured.read(results / "paper" / "box-1.json") == box_1

    @pytest.mark.usefixtures("box_1")
    def test_renders_nothing_twice(
        self, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before = {path: path.stat().st_mtime_ns for path in data.rglob("*")}
        monkeypatch.setattr(report, "RESULTS", tmp_path)
        paper.run(cases(("box",))[:1], SIZE, data, workers=1)
        assert {path: path.stat().st_mtime_ns for path in data.rglob("*")} == before


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
