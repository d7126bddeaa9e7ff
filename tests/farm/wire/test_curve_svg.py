"""A curve as a drawing: any can be drawn, and the values of a rule with its own."""

import re
from datetime import datetime, timezone
from typing import Any

import pytest

from plateau.farm.model.job import CurvePoint, WatchedValue
from plateau.farm.model.spec import JobSpec
from plateau.farm.wire.curve_svg import curve_svg


def point(spp: int, visible: int = 100, **more: Any) -> CurvePoint:
    known = {"visible_fraction": 0.5, "slope": None, "estimate_fraction": None}
    asked = {**known, "estimate_pixels": None, "at": datetime.now(timezone.utc), **more}
    return CurvePoint(spp=spp, visible_pixels=visible, **asked)


@pytest.mark.parametrize(
    ("visible", "estimate"), [(0, None), (1, 0.0), (40_000, 0.02), (3_000_000, 5e6)]
)
def test_any_curve_can_be_drawn(visible: int, estimate: float | None) -> None:
    points = [point(spp, visible, estimate_pixels=estimate) for spp in (25, 50)]
    drawing = curve_svg(JobSpec(), 768, points)
    numbers = [float(one) for one in re.findall(r'(?:[xy][12]?|c[xy])="([-\d.]+)"', drawing)]
    assert len(numbers) > 20
    assert all(-1 <= number <= 800 for number in numbers)
    assert "nan" not in drawing


def test_a_job_is_not_said_to_stop_where_the_one_before_it_did() -> None:
    stopped = {"jod": WatchedValue(value=9.0, stop=True)}
    points = [point(spp, rules=stopped) for spp in (100, 200)]
    first, second = (
        re.findall('<line class="own stop" x1="([0-9.]+)"', drawing)
        for drawing in (
            curve_svg(JobSpec(), 768, points),
            curve_svg(JobSpec(), 768, points, continued_spp=100),
        )
    )
    assert float(first[0]) < float(second[0])


def test_the_values_of_a_rule_with_its_own_have_a_plot() -> None:
    points = [
        point(spp, rules={"jod": WatchedValue(value=value, stop=False)})
        for spp, value in ((100, None), (200, 8.4), (300, 9.1))
    ]
    spec = JobSpec.model_validate({"rule": {"name": "jod", "target": 9.5}})
    drawing = curve_svg(spec, 1000, points)
    assert "quality, in JOD" in drawing
    assert "target 9.5 JOD" in drawing
    assert drawing.count("<circle") == 3 + 2
    assert "JOD" not in curve_svg(JobSpec(rule="visible"), 1000, points)
