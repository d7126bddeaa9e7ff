"""Start-up in its short form: that it runs, and what it leaves."""

import json
from dataclasses import asdict

import pytest

from bench import startup
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
