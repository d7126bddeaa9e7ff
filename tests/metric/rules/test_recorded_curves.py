"""The rules on curves that were recorded from renders: bumpy, as only real ones are.

What a rule compares is looked up, not worked out: an image says no more than at how many samples
per pixel it was taken.
"""

import csv
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from plateau.metric import Estimate, Evidence, VisibleDifferences, create_rule
from plateau.metric.vdp import Difference
from tests.support.images import PAPER

CURVES = Path(__file__).parents[2] / "reference" / "curves"
#: Of every recorded image.
SHAPE = (256, 256)
PIXELS = SHAPE[0] * SHAPE[1]
BRIGHT = np.full((8, 1, 1), 50, np.float32)


def rows(name):
    """The rows of a recorded table; cells left empty are None."""
    lines = (CURVES / f"{name}.csv").read_text().splitlines()
    table = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [{key: float(cell) if cell else None for key, cell in row.items()} for row in table]


class RecordedPercept(NamedTuple):
    spp: int
    shape: tuple[int, int] = SHAPE
    levels: np.ndarray = BRIGHT


class Recorded(VisibleDifferences):
    """Answers with the counts that were recorded, by the spp of reference and test."""

    def __init__(self, counts, estimates=()):
        super().__init__(PAPER)
        self.counts, self.estimates = counts, dict(estimates)

    def percept(self, image):
        return RecordedPercept(int(image[0, 0, 0]))

    def compare(self, reference, test):
        count = self.counts[reference.spp, test.spp] if reference.spp < test.spp else 0
        return Difference(np.zeros((1, 1), bool), count, count / PIXELS, 0)


class RecordedEvidence(Evidence):
    @cached_property
    def estimate(self):
        pixels = self.metric.estimates.get(self.spp)
        if pixels is None:
            return None
        return Estimate(pixels, pixels / PIXELS, pixels, pixels, 0.0, np.zeros((1, 1), np.float32))


def judged(rule, recorded, spps):
    """What the rule says at each of these spp."""
    images = ((spp, np.full((1, 1, 3), spp, np.float32)) for spp in spps)
    return [rule.judge(RecordedEvidence(spp, image, None, recorded)) for spp, image in images]


def first_stop(rule, recorded, spps):
    verdicts = judged(rule, recorded, spps)
    return next(spp for spp, verdict in zip(spps, verdicts, strict=True) if verdict.stop)


BOX = Recorded(
    {
        (row["reference_spp"], row["test_spp"]): int(row["visible_pixels"])
        for row in rows("box-1-comparisons")
    },
    {row["spp"]: row["estimate_pixels"] for row in rows("box-1-estimates")},
)
BOX_TRUTH = {row["spp"]: row["truly_visible_pixels"] for row in rows("box-1-estimates")}


class TestOurBox:
    """scenes/box, every slice of it."""

    # Each is the first spp that fulfils the rule's definition in docs/stopping.md, found in the
    # table without any rule.
    @pytest.mark.parametrize(
        ("name", "step", "stop"),
        [
            ("successive", 50, 400),
            ("successive", 100, 500),
            ("multiple", 50, 800),
            ("multiple", 100, 1300),
            ("myszkowski", 50, 1700),
            ("myszkowski", 100, 1800),
            ("reverse", 50, 2050),
            ("reverse", 100, 3400),
        ],
    )
    def test_a_rule_stops_where_its_definition_says(self, name, step, stop):
        assert first_stop(create_rule(name), BOX, range(step, 3601, step)) == stop

    @pytest.mark.parametrize("step", [50, 100, 200])
    def test_visible_stops_about_where_the_truth_falls_to_its_target(self, step):
        rule = create_rule("visible")
        stop = first_stop(rule, BOX, range(step, 3601, step))
        allowed = rule.target * PIXELS
        on_time = 50 + max(spp for spp, count in BOX_TRUTH.items() if count > allowed)
        assert 0.8 * on_time < stop <= 1.2 * on_time
        assert BOX_TRUTH[stop] < 2 * allowed

    def test_successive_stops_while_the_noise_is_plain_to_see(self):
        stop = first_stop(create_rule("successive"), BOX, range(50, 3601, 50))
        assert BOX_TRUTH[stop] > 0.004 * PIXELS
