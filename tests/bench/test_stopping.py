"""`make bench-stopping` in small: when each rule stops, on noise of which the truth is known."""

from pathlib import Path

import numpy as np
import pytest

from bench import stopping
from bench.stopping import Case, Outcome
from bench.support import report


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def outcomes(results: Path) -> list[Outcome]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "RESULTS", results)
        return stopping.run(seeds=3, quick=True)


def lateness(outcomes: list[Outcome], rule: str) -> list[float]:
    """By case, the median run's; where it never stopped, as if it had at the cap."""
    return [
        float(np.median([stop.lateness for stop in one.stops] + [stopping.CAP] * one.never))
        for one in outcomes
        if one.rule == rule
    ]


def test_every_rule_is_judged_in_every_case(outcomes: list[Outcome]) -> None:
    cases = {one.case for one in outcomes}
    assert {(one.case, one.rule) for one in outcomes} == {
        (case, rule) for case in cases for rule in stopping.JUDGED
    }
    assert all(len(one.stops) + one.never == 3 for one in outcomes)


def test_visible_is_on_time_and_hardly_ever_false(outcomes: list[Outcome]) -> None:
    # Of 24 × 24 pixels a single one, which is always allowed, counts as false.
    of_size = [one for one in outcomes if one.rule == "visible" and one.case.size >= 48]
    assert sum(one.false for one in of_size) / len(of_size) < 0.1
    # Where the noise is weak the steps are coarse beside the spp that are on time.
    strong = [one for one in outcomes if one.case.level >= 0.3]
    assert all(0.7 < late < 2.2 for late in lateness(strong, "visible"))


def test_successive_stops_too_early_where_the_step_is_small(outcomes: list[Outcome]) -> None:
    small = [one for one in outcomes if one.rule == "successive" and one.case.step == 25]
    assert all(one.false == 1 for one in small)


def test_reverse_depends_on_the_step_more_than_visible(outcomes: list[Outcome]) -> None:
    def base(one: Outcome) -> Case:
        return Case(size=48, step=one.case.step)

    def spread(rule: str) -> float:
        by_step = lateness([one for one in outcomes if one.case == base(one)], rule)
        return max(by_step) / min(by_step)

    assert spread("reverse") > spread("visible")


@pytest.mark.usefixtures("outcomes")
def test_it_leaves_a_report_and_a_picture_of_each_study(results: Path) -> None:
    assert {path.name for path in results.iterdir()} == {
        "stopping-quick.json",
        *(f"stopping-quick-{study}.png" for study in ("step", "size", "level")),
    }
