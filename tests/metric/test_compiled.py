"""The compiled predictor agrees with the plain one, on goldens and on what is hard for it."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from metric import View, VisibleDifferences
from metric.compiled import CompiledVisibleDifferences

GOLDENS = Path(__file__).parents[1] / "reference" / "goldens"
ROWS = json.loads((GOLDENS / "counts.json").read_text())


def read(name):
    with Image.open(GOLDENS / f"{name}.png") as file:
        return np.asarray(file, np.float32) / np.float32(255)


def both(view, reference, test):
    """What the plain and the compiled predictor say."""
    found = []
    for kind in (VisibleDifferences, CompiledVisibleDifferences):
        metric = kind(view)
        found.append(metric.compare(metric.percept(reference), metric.percept(test)))
    return found


def noisy_pair(size, sigma, seed=0):
    rng = np.random.default_rng(seed)
    coarse = rng.random((-(-size[0] // 8), -(-size[1] // 8), 3))
    base = coarse.repeat(8, 0).repeat(8, 1)[: size[0], : size[1]]
    return [(base + sigma * rng.standard_normal(base.shape)).astype(np.float32) for _ in "ab"]


@pytest.mark.parametrize("row", ROWS[::3], ids=lambda row: f"{row['pair']}-{row['gamma']}")
def test_the_goldens_hold_within_two_pixels(row):
    view = View(
        field_of_view_deg=row["field_of_view_deg"],
        white_luminance=row["white_luminance"],
        gamma=row["gamma"],
        luminance_only=row["luminance_only"],
        primaries="adobe1998",
    )
    _, compiled = both(view, read(f"{row['pair']}.a"), read(f"{row['pair']}.b"))
    assert abs(compiled.count - row["visible_pixels"]) <= 2


@pytest.mark.parametrize("sigma", [0.3, 0.1, 0.03, 0.01, 0.003])
@pytest.mark.parametrize("view", [View(), View(luminance_only=True), View(white_luminance=8)])
def test_noise_is_judged_alike_on_all_but_one_pixel_in_ten_thousand(sigma, view):
    plain, compiled = both(view, *noisy_pair((256, 256), sigma))
    assert np.count_nonzero(plain.visible != compiled.visible) <= 256 * 256 * 1e-4
    assert compiled.count == np.count_nonzero(compiled.visible)


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (2, 3), (5, 5), (7, 130), (33, 17)])
def test_small_images_are_judged_alike(size):
    plain, compiled = both(View(), *noisy_pair(size, 0.1))
    np.testing.assert_array_equal(plain.visible, compiled.visible)


def test_what_is_not_finite_is_visible_and_hides_nothing_beside_it():
    reference, test = noisy_pair((64, 64), 0.05)
    test[5, 5, 1], test[20, 30, 0], reference[40, 40, 2] = np.nan, np.inf, -np.inf
    plain, compiled = both(View(), reference, test)
    np.testing.assert_array_equal(plain.visible, compiled.visible)
    assert compiled.non_finite == plain.non_finite == 3
    assert compiled.visible[5, 5]
    assert compiled.visible[20, 30]
    assert compiled.visible[40, 40]


def test_an_image_does_not_differ_from_itself():
    image, _ = noisy_pair((48, 48), 0.2)
    _, compiled = both(View(), image, image.copy())
    assert compiled.count == 0


def test_a_reference_that_is_used_often_gives_the_same_answers():
    # It is prepared anew at first, and kept later
    reference, test = noisy_pair((64, 96), 0.05)
    metric = CompiledVisibleDifferences(View())
    prepared = metric.percept(reference)
    found = [metric.compare(prepared, metric.percept(test)).visible for _ in range(6)]
    for later in found[1:]:
        np.testing.assert_array_equal(found[0], later)


def test_percepts_of_another_predictor_are_refused():
    image = np.ones((8, 8, 3), np.float32)
    plain, compiled = VisibleDifferences(View()), CompiledVisibleDifferences(View())
    with pytest.raises(TypeError, match="PreparedPercept"):
        compiled.compare(plain.percept(image), compiled.percept(image))
