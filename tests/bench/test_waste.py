"""Waste in its short form: that it runs, and that what it counts adds up."""

import json
from dataclasses import asdict

from bench import waste
from bench.support.farms.synthetic_noise import Render
from bench.support.report import machine


def test_what_workers_render_for_nothing_is_counted() -> None:
    renders = [Render("checks", "Gaussian", 0.15, 48, seed) for seed in range(2)]
    ended = waste.measure(renders, 3, 0.01)
    assert [one.spp % 100 for one in ended] == [0, 0]
    for one in ended:
        # Of at most two slices a worker
        assert 0 <= one.wasted * one.spp <= 150
        assert 0 < one.waited < 1
    made = {
        "machine": machine(),
        "settings": {"workers": [3]},
        "figures": [asdict(one) for one in waste.figures(3, ended)],
    }
    assert waste.tables(json.loads(json.dumps(made)))["waste"].splitlines()[-1].startswith("| 3 |")
