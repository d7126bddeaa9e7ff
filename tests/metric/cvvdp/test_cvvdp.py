"""ColorVideoVDP: the authors' numbers on 132 pairs, and what a user of the model relies on."""

import functools
import json

import numpy as np
import pytest

from plateau.metric.cvvdp import (
    DISPLAYS,
    ColorVideoVDP,
    Display,
    pixels_per_degree,
    pooling,
    pyramid,
)
from tests.support.images import quality_goldens

ROWS = json.loads(quality_goldens.STILLS.read_text())


@functools.cache
def model(display):
    return ColorVideoVDP(Display(**quality_goldens.DISPLAYS[display]))


def compared(metric, reference, test, **options):
    return metric.compare(metric.percept(reference), metric.percept(test), **options)


@pytest.fixture(scope="module")
def images():
    return quality_goldens.pair("disks noise 135x240")


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['pair']} {row['display']}")
def test_the_authors_numbers(row):
    quality = compared(model(row["display"]), *quality_goldens.pair(row["pair"]), heat=True)
    assert quality.jod == pytest.approx(row["jod"], abs=0.001)
    assert quality.heat.mean() == pytest.approx(row["mean_heat"], rel=0.01, abs=1e-4)


def test_equal_images_are_perfect(images):
    quality = compared(model("desk"), images[0], images[0], heat=True)
    assert quality.jod == 10
    assert not quality.heat.any()


def test_the_heat_is_where_the_difference_is():
    reference = np.full((64, 64, 3), 0.4, np.float32)
    test = reference.copy()
    test[8:12, 40:44] = 0.8
    heat = compared(model("near desk"), reference, test, heat=True).heat
    y, x = np.unravel_index(heat.argmax(), heat.shape)
    assert 8 <= y < 12
    assert 40 <= x < 44
    assert heat[48:, :16].max() < heat.max() / 100
    assert compared(model("near desk"), reference, test).heat is None


def test_rendered_light_is_shown_as_its_srgb_code_values_are(images):
    codes = [image.astype(np.float64) for image in images]
    radiance = [np.where(v > 0.04045, ((v + 0.055) / 1.055) ** 2.4, v / 12.92) for v in codes]
    shown = compared(ColorVideoVDP(Display(transfer="relative")), *radiance).jod
    assert shown == pytest.approx(compared(ColorVideoVDP(Display()), *images).jod, abs=1e-4)


def test_light_beyond_white_is_shown_as_white():
    display = ColorVideoVDP(Display(transfer="relative"))
    white, lamp = np.ones((16, 16, 3)), np.full((16, 16, 3), 50.0)
    assert compared(display, white, lamp).jod == 10


def test_the_standard_displays():
    four_k = DISPLAYS["standard_4k"]
    assert four_k.pixels_per_degree == pytest.approx(75.4, abs=0.05)
    assert four_k.reflected == pytest.approx(0.398, abs=0.001)
    # Twice as far away, and twice as many pixels in a degree.
    assert pixels_per_degree((1920, 1080), 24, 1.2) == pytest.approx(75.66, abs=0.05)


@pytest.mark.parametrize("shape", [(5, 4), (4, 5), (7, 7), (16, 33), (31, 64)])
def test_a_flat_level_stays_flat_where_rows_and_columns_are_alike(shape):
    flat = np.full((3, *shape), 7, np.float32)
    height, width = shape
    coarse = pyramid.halved(flat)
    assert coarse.shape == (3, (height + 1) // 2, (width + 1) // 2)
    inside = coarse if height % 2 == width % 2 else coarse[..., :-1]
    np.testing.assert_allclose(inside, 7, rtol=1e-6)
    ones = np.full(coarse.shape[1:], 7, np.float32)
    np.testing.assert_allclose(pyramid.expanded(ones, shape), 7, rtol=1e-6)


def test_jod_is_continuous_and_falls():
    differences = np.linspace(0, 50, 10_001)
    jod = pooling.jod(differences)
    assert jod[0] == 10
    assert (np.diff(jod) < 0).all()
    assert np.abs(np.diff(jod)).max() < 0.001


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"peak": 0}, "peak must be"),
        ({"black": 200}, "below the peak"),
        ({"pixels_per_degree": float("nan")}, "pixels_per_degree must be"),
        ({"transfer": "gamma"}, "transfer is one of srgb, relative"),
        ({"primaries": "p3"}, "primaries is one of"),
    ],
)
def test_a_display_that_cannot_be(wrong, says):
    with pytest.raises(ValueError, match=says):
        Display(**wrong)


def test_images_that_cannot_be_judged():
    metric = model("desk")
    grey = np.full((8, 8, 3), 0.5)
    for image, says in [
        (grey[:3], "too small"),
        (grey * np.nan, "finite in every pixel"),
        (grey * 3, r"code values lie in \[0, 1\], not in \[1.5, 1.5\]"),
        (grey[..., :2], "(H, W, 3)"),
    ]:
        with pytest.raises(ValueError, match=says):
            metric.percept(image)
    with pytest.raises(ValueError, match="same size"):
        compared(metric, grey, np.full((8, 9, 3), 0.5))
    with pytest.raises(ValueError, match="met Display"):
        metric.compare(metric.percept(grey), model("wall").percept(grey))
