"""Start-up, latency and memory in their short forms: that they run, and what they leave."""

import json
from dataclasses import asdict

import pytest

from bench import latency, lease, memory, startup
from bench.support.report import Figure, machine


def report(figures: list[Figure], settings: dict[str, object]) -> dict[str, object]:
    made = {"machine": machine(), "settings": settings, "figures": [asdict(one) for one in figures]}
    assert json.loads(json.dumps(made)) == made
    return made


@pytest.mark.timeout(600)
@pytest.mark.long
def test_starts_are_compared_with_mitsuba_alone() -> None:
    found = startup.measure(startup.Plan(pairs=1, helps=1, size=16, variant="scalar_rgb"))
    # The default rule needs two points to stop
    assert found.spp == 200
    assert {kind: len(pairs) for kind, pairs in found.pairs.items()} == dict.fromkeys(
        startup.KERNELS, 1
    )
    for pairs in found.pairs.values():
        for ours, bare in pairs:
            assert 0 < bare.cpu_s < ours.cpu_s
    shown = startup.tables(
        report(startup.figures(found), {"size": "16×16", "spp": found.spp, "pairs": 1})
    )
    assert all(kind in shown["startup"] for kind in startup.KERNELS)
    assert startup.HELP in shown["startup-help"]


@pytest.mark.timeout(600)
@pytest.mark.long
def test_a_job_is_seen_judged_and_left_alone() -> None:
    kind = latency.Kind(scene="still", size=16, jobs=2)
    cancelled = latency.Kind(scene="box", size=32, jobs=1, cancelled=True)
    found = latency.measure(latency.Plan(kinds=(kind, cancelled), threads=1, variant="scalar_rgb"))
    seconds = found.seconds[kind.name]
    assert {name: len(values) for name, values in seconds.items()} == {
        latency.PREVIEW: 2,
        latency.POINT: 4,
        latency.IDLE: 2,
    }
    assert len(found.seconds[cancelled.name][latency.IDLE]) == 1
    assert all(value >= 0 for values in seconds.values() for value in values)
    jobs = {one.name: one.jobs for one in (kind, cancelled)}
    made = report(latency.figures(found), {"kinds": jobs, "workers": 1, "threads": 1})
    assert f"| {latency.POINT} |" in latency.tables(made)["latency"]


@pytest.mark.timeout(600)
@pytest.mark.long
def test_each_process_is_asked_for_its_memory() -> None:
    plan = memory.Plan(sizes={"tiny": (32, 24)}, many={"tiny": 3}, threads=1, variant="scalar_rgb")
    found = memory.measure(plan)
    assert set(found["tiny"][1]) == set(memory.ROLES)
    assert set(found["tiny"][3]) == {"API", "monitor"}
    # An interpreter alone takes ten
    assert min(mb for roles in found["tiny"].values() for mb in roles.values()) > 10
    shown = memory.tables(report(memory.figures(found), {}))
    assert [line.split("|")[2].strip() for line in shown["memory"].splitlines()[2:]] == ["1", "3"]


@pytest.mark.timeout(600)
@pytest.mark.long
def test_the_second_job_of_a_scene_is_timed_beside_the_first() -> None:
    plan = lease.Plan(scenes=("box",), size=16, rounds=2, threads=1, variant="scalar_rgb")
    found = lease.measure(plan)
    assert [len(one) for one in found.seconds["box"]] == [2, 2]
    assert all(seconds > 0 for both in found.seconds.values() for one in both for seconds in one)
    made = report(lease.figures(found), {"size": "16×16", "rounds": 2, "workers": 1, "threads": 1})
    shown = lease.tables(made)["lease"].splitlines()
    assert shown[0] == f"| lease to first sample, s | {' | '.join(lease.JOBS)} |"
    assert shown[-1].startswith("| box |")
