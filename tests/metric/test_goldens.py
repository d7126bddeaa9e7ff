"""The counts of PerceptualDiff 2.1 on twelve pairs, each under ten viewing conditions."""

import functools
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from plateau.metric import View, VisibleDifferences
from plateau.metric.compiled import CompiledVisibleDifferences

GOLDENS = Path(__file__).parents[1] / "reference" / "goldens"
ROWS = json.loads((GOLDENS / "counts.json").read_text())


def row_id(row):
    return "-".join(str(value) for key, value in row.items() if key != "visible_pixels")


@functools.cache
def read(name):
    with Image.open(GOLDENS / f"{name}.png") as file:
        return np.asarray(file, np.float32) / np.float32(255)


@pytest.mark.parametrize("row", ROWS, ids=row_id)
@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
def test_the_count_is_within_two_pixels(predictor, row):
    view = View(
        field_of_view_deg=row["field_of_view_deg"],
        white_luminance=row["white_luminance"],
        gamma=row["gamma"],
        luminance_only=row["luminance_only"],
        primaries="adobe1998",
    )
    metric = predictor(view)
    reference, test = (metric.percept(read(f"{row['pair']}.{side}")) for side in "ab")
    assert reference.shape == (row["height"], row["width"])

    difference = metric.compare(reference, test)

    assert abs(difference.count - row["visible_pixels"]) <= 2
    # Exchanging reference and test changes no pixel.
    assert np.array_equal(difference.visible, metric.compare(test, reference).visible)
