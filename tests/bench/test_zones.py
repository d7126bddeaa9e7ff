"""Wall time by zones in its short form: that it runs, and that its table has it."""

import json
from dataclasses import asdict

from bench import zones
from bench.support.farms.synthetic_noise import Render
from bench.support.report import machine


def test_zones_are_compared_with_frames() -> None:
    pairs = zones.measure([Render("ramp", "Gaussian", 0.15, 48, 1)], 3, 20)
    assert 0 < pairs[0].spp < 2
    assert pairs[0].seconds > 0
    made = {
        "machine": machine(),
        "settings": {"cases": [[3, 20]]},
        "figures": [asdict(one) for one in zones.figures(3, 20, pairs)],
    }
    table = zones.tables(json.loads(json.dumps(made)))["zones"]
    assert table.splitlines()[-1].startswith("| 3 | 20 ms |")
