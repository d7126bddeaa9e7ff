"""Zones with different numbers of samples make an image without edges."""

from dataclasses import replace

import numpy as np
import pytest

from plateau.farm.images.exr import Partial
from plateau.farm.model.slices.zones import Grid
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.spec.parts import ZonesAllocation
from plateau.picture.merge import Merge
from tests.support.images.plain_exr import partial_of

GRID = Grid(40, 24, 16)
SPEC = JobSpec(allocation=ZonesAllocation(size=16))


def partial(index: int, spp: int, numbers: list[int] | None, border: int) -> Partial:
    """A slice of a grey film, whose samples each give the same to every pixel around them."""
    zones = GRID.zones(numbers)
    reach = 2 * border + 1
    parts = []
    for zone in zones:
        block = zone.with_border(border, GRID.width, GRID.height)
        weights = np.zeros((block.height, block.width), np.float32)
        for y in range(zone.y, zone.y + zone.height):
            for x in range(zone.x, zone.x + zone.width):
                top, left = max(0, y - border - block.y), max(0, x - border - block.x)
                bottom, right = y + border + 1 - block.y, x + border + 1 - block.x
                weights[top:bottom, left:right] += spp / reach**2
        light = weights * LIGHT[block.y : block.y + block.height, block.x : block.x + block.width]
        parts.append(np.stack([light, light, light, weights], -1).reshape(-1, 4))
    return partial_of(np.concatenate(parts), index, spp=spp, zones=zones, border=border)


LIGHT = np.linspace(0.1, 1, 24 * 40, dtype=np.float32).reshape(24, 40)


@pytest.mark.parametrize("border", [0, 2])
def test_zones_of_one_light_have_it_whatever_their_samples(border: int) -> None:
    merge = Merge.of(SPEC)
    merge.add_partial(partial(0, 8, None, border))
    merge.add_partial(partial(1, 8, None, border))
    merge.add_partial(partial(2, 400, [0, 4], border))
    merge.add_partial(partial(3, 400, [0, 4], border))
    np.testing.assert_allclose(merge.image()[..., 0], LIGHT, rtol=1e-5)
    halves = merge.halves()
    assert halves is not None
    for half in halves:
        np.testing.assert_allclose(half.mean[..., 0], LIGHT, rtol=1e-5)
        assert half.spp == merge.samples / GRID.width / GRID.height / 2
    assert merge.zone_spp is not None
    assert merge.zone_spp.tolist() == [[816, 16, 16], [16, 816, 16]]
    spp_map = merge.spp_map()
    assert spp_map is not None
    assert merge.samples == spp_map.sum()


def test_under_a_wide_filter_a_denser_zone_weighs_no_more_in_its_neighbours() -> None:
    merge = Merge.of(SPEC)
    for index in (0, 1):
        merge.add_partial(partial(index, 8, None, 2))
    # When the samples of zone 0 alone are bright from now on, and many
    for index in (2, 3):
        one = partial(index, 800, [0], 2)
        bright = one.pixels.copy()
        bright[:, :3] *= 3
        merge.add_partial(replace(one, pixels=bright))
    image = merge.image()[..., 0]
    # Then a pixel beyond its edge has of it what the filter says: two fifths, and no more
    assert image[8, 16] / LIGHT[8, 16] == pytest.approx(1 + 0.4 * 2, rel=0.02)
    assert image[8, 18] == pytest.approx(LIGHT[8, 18], rel=1e-5)


def test_a_checkpoint_has_them() -> None:
    merge, again = Merge.of(SPEC), Merge.of(SPEC)
    merge.add_partial(partial(0, 8, None, 2))
    merge.add_partial(partial(1, 8, None, 2))
    again.restore(merge.slices, merge.arrays(), merge.about())
    for one in (merge, again):
        one.add_partial(partial(2, 5, [3], 2))
    assert merge.image().tobytes() == again.image().tobytes()
    assert again.samples == merge.samples


@pytest.mark.parametrize(
    "change",
    [{"border": 1}, {"zones": GRID.zones([1])}, {"pixels": np.zeros((7, 4), np.float32)}],
    ids=lambda change: next(iter(change)),
)
def test_a_film_of_another_shape_is_refused(change: dict[str, object]) -> None:
    merge = Merge.of(SPEC)
    merge.add_partial(partial(0, 8, None, 2))
    with pytest.raises(ValueError, match=r"border|pixels"):
        merge.add_partial(replace(partial(1, 8, [0], 2), **change))
