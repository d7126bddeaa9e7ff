"""The scale benchmark in its short form: that it runs, and what it leaves, not its figures."""

from pathlib import Path

import pytest

from bench import scale
from bench.support import scale_farm


@pytest.mark.timeout(600)
@pytest.mark.long
def test_workers_and_jobs_are_simulated_under_each_load(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two processes of simulated workers, with three and two of them
    monkeypatch.setattr(scale_farm, "_CREWS", 2)
    monkeypatch.setattr(scale_farm, "_MONITOR_LEASE_S", 3.0)
    plan = scale.Plan(
        workers=(5,),
        jobs=(2,),
        render_s=0.3,
        rates=(20.0,),
        monitors=(2,),
        warm_s=0.3,
        seconds=1.5,
        folder=str(tmp_path),
    )
    # Then slices are committed and merged under each, be it not in the moment that is measured
    figures = ("committed", "merged", "Redis", "commit: median")
    for _ in range(5):
        found = scale.measure(plan)
        least = min(load.get(name, 0) for load in found.loads.values() for name in figures)
        if least > 0:
            break
    assert least > 0
    assert set(found.loads) == {"5 workers, 2 jobs", "20/s asked of 2 monitors"}
    # The tables have a line for each
    rows = {row[0] for table in scale.tables(plan, found).values() for row in table}
    assert rows >= {"5 workers", "20/s asked of 2 monitors"}
