"""Start-up in its short form: that it runs, and what it leaves."""

import pytest

from bench import startup


@pytest.mark.timeout(600)
@pytest.mark.long
def test_starts_are_compared_with_mitsuba_alone() -> None:
    plan = startup.Plan(pairs=1, size=16, variant="scalar_rgb")
    found = startup.measure(plan)
    # The default rule needs two points to stop
    assert found.spp == 200
    [(ours, bare)] = found.pairs
    assert 0 < bare.cpu_s < ours.cpu_s
    tables = startup.tables(plan, found)
    assert [row[0] for row in tables["startup"][1:]] == ["a start"]
