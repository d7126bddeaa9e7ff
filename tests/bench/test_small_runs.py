"""The experiment in small: the farm renders once, then the paper and the savings are made of it."""

import json
from pathlib import Path

import pytest

from bench import paper, savings
from bench.experiment.cases import cases
from bench.experiment.renders import longest
from bench.experiment.savings_tables import time_ratios
from bench.experiment.series import Measured
from bench.experiment.spending import CYCLES_ADAPTIVE, FIXED_SPP, RULES, Spending
from bench.support import report
from plateau.farm.model.spec import (
    JobSpec,
    MultipleSpec,
    MyszkowskiSpec,
    ReverseSpec,
    SuccessiveSpec,
)
from plateau.files.image_series import find_series, judge_series
from tests.bench.conftest import SIZE


@pytest.fixture(scope="module")
def paper_box(data: Path, results: Path) -> Measured:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "RESULTS", results)
        [measured] = paper.run(cases(("box",))[:1], SIZE, data, workers=1)
    return measured


@pytest.mark.long
class TestThePaper:
    def test_holds_every_image_against_a_reference_of_other_samples(
        self, paper_box: Measured
    ) -> None:
        assert paper_box.spp == list(range(50, 601, 50))
        # Its own last image would be no different from itself.
        assert paper_box.truth[0] > paper_box.truth[-1] > 0

    def test_stops_where_plateau_judge_does(self, paper_box: Measured, data: Path) -> None:
        spec = JobSpec(
            step=100,
            watch=(ReverseSpec(), MultipleSpec(window=5), SuccessiveSpec(), MyszkowskiSpec()),
        )
        slices = data / "box-1-24-600-series" / "slices"
        judged = judge_series(find_series(slices, image_spp=None, cumulative=False), spec)
        assert judged.stops == {
            "reverse": paper_box.curves["reverse @100"].stop,
            "multiple": paper_box.curves["multiple, window 5 @100"].stop,
            "successive": paper_box.curves["successive @100"].stop,
            "myszkowski": paper_box.curves["myszkowski @100"].stop,
            "visible": paper_box.curves["visible @100"].stop,
        }
        assert [point.visible_pixels for point in judged.points] == paper_box.curves[
            "reverse @100"
        ].visible

    def test_leaves_tables_pictures_and_curves(self, paper_box: Measured, results: Path) -> None:
        left = {path.name for path in (results / "paper").iterdir()}
        assert left == {
            "box-1.json",
            *(f"{name}.png" for name in ("figure-4", "figure-5", "figure-6", "truth")),
        }
        assert Measured.read(results / "paper" / "box-1.json") == paper_box

    @pytest.mark.usefixtures("paper_box")
    def test_renders_nothing_twice(
        self, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before = {path: path.stat().st_mtime_ns for path in data.rglob("*")}
        monkeypatch.setattr(report, "RESULTS", tmp_path)
        paper.run(cases(("box",))[:1], SIZE, data, workers=1)
        assert {path: path.stat().st_mtime_ns for path in data.rglob("*")} == before


@pytest.fixture(scope="module")
def savings_box(data: Path, results: Path) -> Spending:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "RESULTS", results)
        [spent] = savings.run(cases(("box",))[:1], SIZE, data, workers=1)
    return spent


@pytest.mark.long
class TestSavings:
    def test_says_of_every_rule_where_it_stopped(self, savings_box: Spending) -> None:
        assert set(savings_box.stops) == set(RULES)
        assert savings_box.spp == list(range(50, 601, 50))
        for rule, stop in savings_box.stops.items():
            assert stop.spp <= 600
            assert (
                rule == CYCLES_ADAPTIVE or stop.seen == savings_box.truth[int(stop.spp) // 50 - 1]
            )
            assert stop.ended or rule == CYCLES_ADAPTIVE or stop.spp == 600

    def test_measures_what_rendering_and_looking_cost(self, savings_box: Spending) -> None:
        assert all(seconds > 0 for seconds in savings_box.spp_s)
        assert all(len(savings_box.look_s[rule]) > 0 for rule in RULES)
        for rule in RULES:
            assert min(time_ratios(savings_box, rule)) > savings_box.stops[rule].spp / FIXED_SPP

    def test_leaves_a_report(self, savings_box: Spending, results: Path) -> None:
        assert Spending.read(results / "savings" / "box-1.json") == savings_box
        figures = json.loads((results / "savings.json").read_text())["figures"]
        assert len(figures) == 1 + 3 * len(RULES)

    @pytest.mark.usefixtures("savings_box")
    def test_takes_the_longest_renders_that_there_are(self, data: Path) -> None:
        case = cases(("box",))[0]
        assert longest(case, 24, data) == SIZE
        assert longest(case, 32, data) is None
        (data / "box-1-24-900-series").mkdir()  # without a reference it is of no use
        assert longest(case, 24, data) == SIZE
