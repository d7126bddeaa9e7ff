"""The scale benchmark in its short form: that it runs, and what it leaves, not its figures."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from bench.scale import figures, tables
from bench.support.farms import scale_farm
from bench.support.load import scale_load
from bench.support.load.scale_load import Plan, measure
from bench.support.report import machine


@pytest.mark.timeout(600)
@pytest.mark.long
def test_workers_and_jobs_are_simulated_under_each_load(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two processes of simulated workers, with three and two of them; and images that are small
    monkeypatch.setattr(scale_farm, "_CREWS", 2)
    monkeypatch.setattr(scale_farm, "_MONITOR_LEASE_S", 3.0)
    monkeypatch.setattr(scale_load, "_SIZES", ((64, 64), (96, 64)))
    plan = Plan(
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
    found = measure(plan)
    # Slices were committed and merged wherever there were both workers and jobs
    loads = {seen.name: seen for seen in found.seen}
    assert set(loads) == {
        "5 workers, 2 jobs",
        "20/s asked of 2 monitors",
        "20/s asked, Redis not waiting for its disk",
        "20/s asked, blobs on the disk",
        "3 idle workers",
        "3 waiting jobs",
    }
    for name, seen in loads.items():
        at_work = not name.startswith("3 ")
        assert bool(seen.slices) == at_work
        assert (seen.spent.merges > 0) == at_work
        assert seen.spent.redis_cpu_s > 0
        assert min((one.commit_s for one in seen.slices), default=1.0) > 0
    # And each request has its cost
    assert all(cpu_us > 0 for cpu_us, _ in found.costs.values())
    # The report has a figure for each, and the document a line
    report = {
        "machine": machine(),
        "settings": asdict(plan),
        "figures": [asdict(one) for one in figures(found)],
    }
    report = json.loads(json.dumps(report))
    lines = "".join(tables(report).values())
    rows = {line.split(" | ")[0].removeprefix("| ") for line in lines.splitlines()}
    assert rows >= {*found.costs, *loads, "5 workers"} - {"5 workers, 2 jobs"}
