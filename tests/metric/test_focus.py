"""Visible pixels count by how much they are looked at: in the estimate, its trend and the zones."""

import numpy as np
import pytest

from plateau.metric import Evidence, Half, Visible, focus_plane
from plateau.metric.compiled import CompiledVisibleDifferences
from tests.support.images import PAPER

METRIC = CompiledVisibleDifferences(PAPER)
GREY, SPP = np.float32(0.4), 400
LEFT, RIGHT = [[1, 0]], [[0, 1]]


def seen(weights=None, *, seed=1, left=0.1, right=0.005):
    """A grey image whose left half is noisier than its right one."""
    sigma = np.full((64, 64), right, np.float32)
    sigma[:, :32] = left
    noise = np.random.default_rng(seed).normal(0, 1, (2, 64, 64, 3)).astype(np.float32)
    even, odd = GREY + sigma[..., np.newaxis] * noise
    focus = None if weights is None else focus_plane(weights, 64, 64)
    halves = Half(even, SPP // 2), Half(odd, SPP // 2)
    return Evidence(SPP, (even + odd) / 2, halves, METRIC, focus=focus)


def test_all_pixels_alike_are_as_no_focus():
    plain, focused = seen(), seen([[0.3]])
    assert plain.estimate.pixels > 100
    assert focused.estimate == plain.estimate
    assert focused.forecast(0.001) == plain.forecast(0.001)


def test_what_nobody_looks_at_counts_nothing():
    left, plain, right = (seen(weights).estimate for weights in (LEFT, None, RIGHT))
    assert left.pixels == 2 * plain.pixels  # the same share of half the image
    assert right.pixels == 0
    assert left.low_pixels < left.pixels < left.high_pixels
    assert (left.visible == plain.visible).all()


def test_a_job_may_end_though_noise_is_left_where_nobody_looks():
    verdicts = [Visible(min_spp=1, target=0.001).judge(seen(weights)) for weights in (None, RIGHT)]
    rule = Visible(min_spp=1, target=0.001)
    rule.judge(seen(RIGHT))
    later = seen(RIGHT, seed=2)
    later = Evidence(
        2 * SPP,
        later.image,
        tuple(Half(half.mean, SPP) for half in later.halves),
        METRIC,
        focus=later.focus,
    )
    assert rule.judge(later).stop
    assert "weighted by the focus" in verdicts[1].reason
    assert verdicts[0].numbers["estimate_pixels"] > verdicts[0].numbers["allowed_pixels"]
    assert "focus" not in verdicts[0].reason


def test_it_needs_more_samples_for_what_is_looked_at():
    left, plain, right = (seen(weights).forecast(0.001) for weights in (LEFT, None, RIGHT))
    assert left > plain > right == SPP


def test_the_next_samples_go_where_people_look():
    spp = np.full((4, 4), SPP)
    even = {"left": 0.05, "right": 0.05}
    for weights, looked_at in ((LEFT, np.s_[:, :2]), (RIGHT, np.s_[:, 2:])):
        plan = seen(weights, **even).allocation(0.0005, spp=spp, planned=spp, size=16)
        assert plan.zones[looked_at].sum() == plan.zones.sum() > 0


@pytest.mark.parametrize("weights", [[], [[]], [[1], [1, 2]], [[-1, 2]], [[np.nan]], [[0, 0]]])
def test_what_is_no_focus_is_refused(weights):
    with pytest.raises(ValueError, match="focus"):
        focus_plane(weights, 8, 8)


def test_it_is_refused_where_no_pixel_has_a_weight():
    # Given more weights than pixels, and a weight between two of them
    with pytest.raises(ValueError, match="nobody would look"):
        focus_plane([[0, 1, 0, 0]], 1, 2)
