"""The curve in braille dots."""

import re
from datetime import datetime, timezone
from itertools import pairwise

import pytest

from plateau.farm.model.job import CurvePoint
from plateau.terminal.curve import LEAST_COLUMNS, LEAST_ROWS, terminal_curve

START = datetime(2026, 1, 1, tzinfo=timezone.utc)


def point(spp: int, visible: float, estimate: float | None) -> CurvePoint:
    return CurvePoint(
        spp=spp,
        visible_pixels=round(visible * 4096),
        visible_fraction=visible,
        slope=None,
        estimate_pixels=estimate and estimate * 4096,
        estimate_fraction=estimate,
        at=START,
    )


def curve(last_spp: int = 1000) -> list[CurvePoint]:
    """A rise to a plateau of 10 %, and an estimate that falls as 1/spp: 2 % at 100 spp."""
    return [point(spp, 0.1 * (1 - 50 / spp), 2 / spp) for spp in range(100, last_spp + 1, 100)]


def drawn(points: list[CurvePoint], **more: object) -> list[str]:
    options = {"target": 2e-4, "columns": 80, "rows": 10}
    return terminal_curve(points, **{**options, **more}).plain.split("\n")


def row_of(lines: list[str], name: str) -> int:
    return next(number for number, line in enumerate(lines) if name in line)


def dots(line: str) -> set[int]:
    return {column for column, letter in enumerate(line) if "\u2800" < letter <= "\u28ff"}


def test_the_axis_is_logarithmic_and_each_line_has_its_name() -> None:
    lines = drawn(curve())
    assert len(lines) == 10
    numbers = [
        float(found.group(1)) for line in lines if (found := re.match(r" *([\d.]+) % \|", line))
    ]
    assert len(numbers) == 8
    # Rows are equal ratios
    ratios = [after / before for before, after in pairwise(numbers)]
    assert ratios == pytest.approx([ratios[0]] * len(ratios), rel=0.1)
    # What is left to see ends at 0.2 %, below what is seen and above the target
    assert row_of(lines, "changed") < row_of(lines, "noise left") < row_of(lines, "target")
    at = row_of(lines, "noise left")
    assert numbers[at] <= 0.2 <= numbers[at - 1]
    assert lines[-2].endswith("(spp)")
    assert re.search(r"\b690\b", lines[-1])


def test_the_target_is_a_line_from_end_to_end() -> None:
    lines = drawn(curve())
    target = dots(lines[row_of(lines, "target")])
    assert min(target) <= 14
    assert max(target) >= 68
    # Another rule has none
    assert not any("target" in line for line in drawn(curve(), target=None))


@pytest.mark.parametrize("columns", [LEAST_COLUMNS, 60, 80, 200])
@pytest.mark.parametrize("rows", [LEAST_ROWS, 9, 16])
@pytest.mark.parametrize("points", [1, 2, 10, 300])
def test_it_fits_the_room_that_it_has(columns: int, rows: int, points: int) -> None:
    lines = drawn(curve(100 * points), columns=columns, rows=rows)
    assert len(lines) == rows
    assert max(map(len, lines)) <= min(columns, 110)


@pytest.mark.parametrize(
    "points", [[point(100, 0.0, None)], [point(100, 0.0, 0.0), point(200, 0.0, 0.0)]]
)
def test_where_nothing_differs_it_says_so(points: list[CurvePoint]) -> None:
    assert drawn(points, target=None) == ["nothing differs visibly, so far"]
    assert row_of(drawn(points), "target")


@pytest.mark.parametrize("share", [1.0, 1e-9, 0.1, 0.0316])
def test_any_share_can_be_drawn(share: float) -> None:
    lines = drawn([point(1, share, share), point(2, share, share)], target=None)
    assert any(dots(line) for line in lines)
    assert any(" | " in line for line in lines)
