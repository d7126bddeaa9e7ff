"""What stopping saves: other renderers' rules on images with known answers, and the tables."""

import numpy as np
import pytest

from bench.support.other_rules import CyclesAdaptive, CyclesThreshold, LuxCoreHalt, cycles_error
from plateau.metric import Image
from tests.support.images import PAPER


def grey(value: float) -> Image:
    return np.full((4, 4, 3), value, np.float32)


def with_one(place: tuple[int, ...], image: Image, value: float) -> Image:
    changed = image.copy()
    changed[place] = value
    return changed


PIXEL, CHANNEL = (1, 2), (3, 0, 2)


def film(value: float, spp: int, *, size: int = 4) -> Image:
    """A slice before normalisation: the sums of radiance, and the weights."""
    return np.full((size, size, 4), [value * spp] * 3 + [spp], np.float32)


class TestLuxCoresRule:
    #: Displayed as 0.5, as 0.519 and as 0.521.
    BEFORE, UNDER, OVER = (value**2.2 for value in (0.5, 0.519, 0.521))

    @pytest.mark.parametrize(
        ("images", "stops"),
        [
            ((grey(BEFORE), grey(UNDER)), True),
            ((grey(BEFORE), with_one(CHANNEL, grey(BEFORE), OVER)), False),
            ((grey(0.1), grey(BEFORE), grey(UNDER)), True),
            ((with_one(PIXEL, grey(0.5), np.nan),) * 2, True),
        ],
        ids=["no pixel", "one channel of one", "since the image before", "not a number"],
    )
    def test_ends_where_no_pixel_changed_by_more_than_the_threshold(
        self, images: tuple[Image, ...], stops: bool
    ) -> None:
        rule = LuxCoreHalt(PAPER)
        ended = [rule.stops(100 + 50 * number, one) for number, one in enumerate(images)]
        assert ended == [*[False] * (len(images) - 1), stops]


class TestCyclesRule:
    def test_error_is_over_the_root_in_the_dark_and_over_the_sum_in_the_light(self) -> None:
        dark = cycles_error(grey(0.12), grey(0.13))
        assert dark[0, 0] == pytest.approx(0.03 / (1e-4 + 0.6), rel=1e-4)
        light = cycles_error(grey(1.2), grey(1.3))
        assert light[0, 0] == pytest.approx(0.3 / (1e-4 + 3.6), rel=1e-4)

    def test_every_pixel_must_be_under_five_times_the_threshold(self) -> None:
        image, rule = grey(0.12), CyclesThreshold()
        assert rule.stops(100, image, grey(0.1299))  # 0.0297 / 0.6001 < 0.05
        assert not rule.stops(100, image, with_one(PIXEL, image, 0.1301))
        assert CyclesThreshold(threshold=0.011).stops(100, image, with_one(PIXEL, image, 0.1301))


def test_a_pixel_of_cycles_goes_on_with_its_neighbours_and_the_others_end() -> None:
    rule = CyclesAdaptive()
    first = film(0.5, 50, size=8)
    first[0, 0] = [100, 100, 100, 50]
    assert not rule.add(first, film(0.5, 50, size=8), 100)
    # Later slices change none but itself, and three neighbours in a corner.
    rule.add(film(0.9, 50, size=8), film(0.9, 50, size=8), 100)
    assert rule.mean_spp == 100 + 100 * 4 / 64
    assert rule.image[4, 4, 0] == pytest.approx(0.5)
    assert rule.image[1, 1, 0] == pytest.approx(0.7)
