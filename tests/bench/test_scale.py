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
        waiting=3,
        turns=5,
        warm_s=0.3,
        seconds=1.5,
        folder=str(tmp_path),
    )
    found = scale.measure(plan)
    # Slices were committed and merged wherever there were both workers and jobs
    assert set(found.loads) == {
        "5 workers, 2 jobs",
        "20/s asked of 2 monitors",
        "3 idle workers",
        "3 waiting jobs",
    }
    for name, load in found.loads.items():
        at_work = not name.startswith("3 ")
        assert (load["committed"] > 0) == at_work
        assert (load["merged"] > 0) == at_work
        assert load["Redis"] > 0
        assert load.get("commit: median", 1.0) > 0
    # And each request has its cost
    assert all(cpu_us > 0 for cpu_us, _ in found.costs.values())
    # The tables have a line for each
    rows = {row[0] for table in scale.tables(plan, found).values() for row in table}
    assert rows >= {*found.costs, *found.loads, "5 workers"} - {"5 workers, 2 jobs"}
