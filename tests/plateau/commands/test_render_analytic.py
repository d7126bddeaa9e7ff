"""`plateau render` of an analytic scene: real processes, and an image whose truth is known."""

import json

import numpy as np
import pytest

from plateau.farm.bundle.analytic import AnalyticScene
from plateau.farm.images.exr import decode_image
from plateau.worker.renderers.analytic.picture import Picture
from tests.support.processes.commands import Command

SIZE = {"width": 40, "height": 30}


@pytest.mark.long
def test_it_converges_by_the_rule_visible_to_the_known_image(tmp_path):
    path = tmp_path / "checks.json"
    path.write_text(json.dumps({"analytic": 1, **SIZE, "light": "checks", "level": 0.2}))
    arguments = ("-o", str(tmp_path / "out"), "--workers", "2", "--threads", "1", "--step", "50")
    with Command("render", str(path), *arguments, "--rule", "visible", folder=tmp_path) as render:
        assert render.exit_code(180) == 0, render.said
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["state"], summary["variant"]) == ("converged", "analytic:numpy")
    assert (summary["spec"]["rule"]["name"], summary["spec"]["rule"]["target"]) == (
        "visible",
        0.0002,
    )
    spp = summary["spp"]
    assert 200 <= spp < 10_000
    image = decode_image((tmp_path / "out" / "image.exr").read_bytes())
    made = Picture(AnalyticScene(**SIZE, light="checks", level=0.2))
    # The noise of each value is known: a normal variable, 0.2 × its light / sqrt(spp). Where there
    # is no light there is no noise.
    lit = made.truth > 0
    deviation = (image - made.truth)[lit] / (0.2 * made.truth[lit] / spp**0.5)
    assert np.allclose(image[~lit], 0)
    # Five standard errors, two-sided: were the seeds not fixed, 1 run of 900,000 would fail.
    count = deviation.size
    assert abs(deviation.mean()) < 5 / count**0.5
    assert abs(deviation.var() - 1) < 5 * (2 / count) ** 0.5
