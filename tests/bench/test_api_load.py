"""The API's benchmark in its short form: that it runs, and what it leaves, not its figures."""

import json
from dataclasses import asdict

import pytest

from bench.api import figures, tables
from bench.support.load.service_load import PHASES, Plan, measure
from bench.support.report import machine

PLAN = Plan(
    jobs=120,
    watchers=12,
    rounds=1,
    seconds=1.0,
    per_s=10.0,
    turns=2,
    callers=2,
    size=32,
    slice_spp=64,
    threads=1,
    variant="scalar_rgb",
)


@pytest.mark.timeout(600)
@pytest.mark.long
def test_each_kind_of_request_is_made_in_each_phase() -> None:
    found = measure(PLAN)
    # Every request was answered, each as often as planned
    kinds = {name: len(rounds[0]) for name, rounds in found.latencies["idle"].items()}
    assert set(kinds.values()) == {round(PLAN.per_s * PLAN.seconds), PLAN.turns}
    for phase in PHASES:
        ones = found.latencies[phase]
        assert {name: [len(one) for one in rounds] for name, rounds in ones.items()} == {
            name: [number] for name, number in kinds.items()
        }
        assert all(second > 0 for rounds in ones.values() for second in rounds[0])
    # Points came while they were watched, and nobody had one before it was there
    assert min(map(min, (*found.delays, *found.bare_delays))) > -0.01
    # The report has a figure for each, and the documents a line
    report = {
        "machine": machine(),
        "settings": asdict(PLAN),
        "figures": [asdict(one) for one in figures(found)],
    }
    assert json.loads(json.dumps(report)) == report
    lines = "".join(tables(report).values())
    for kind in kinds:
        assert f"| {kind} |" in lines
    names = {one["name"] for one in report["figures"]}
    assert {
        "watched: GET a job: p99",
        "watched: GET a job: ratio",
        "a point's way to the last watcher: slowest",
        "other work on the cores meanwhile",
    } <= names
