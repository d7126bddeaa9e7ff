"""Zones cover the image once, along multiples of 16 pixels."""

from itertools import pairwise

import numpy as np
import pytest

from plateau.metric import zone_edges, zone_fractions


@pytest.mark.parametrize("size", [1, 15, 16, 17, 100, 333, 512, 1080, 1920])
@pytest.mark.parametrize("zones", [1, 3, 4, 7, 64])
def test_zones_cover_a_line_once_and_are_aligned(size, zones):
    edges = zone_edges(size, zones)
    assert (edges[0], edges[-1]) == (0, size)
    assert all(edge % 16 == 0 for edge in edges[:-1])
    assert all(a < b for a, b in pairwise(edges))
    assert len(edges) - 1 == min(zones, -(-size // 16))


def test_fractions_weigh_up_to_the_whole():
    visible = np.random.default_rng(3).random((100, 333)) < 0.2
    fractions = zone_fractions(visible, (3, 5))
    rows, columns = np.diff(zone_edges(100, 3)), np.diff(zone_edges(333, 5))
    assert fractions.shape == (3, 5)
    assert (fractions * np.outer(rows, columns)).sum() == pytest.approx(visible.sum())


@pytest.mark.parametrize(("size", "zones"), [(0, 4), (4, 0), (-1, 1)])
def test_nothing_has_no_zones(size, zones):
    with pytest.raises(ValueError, match="zones"):
        zone_edges(size, zones)
