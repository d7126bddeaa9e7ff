"""The quality of a shot without a reference: noise counts, and movement does not."""

import numpy as np
import pytest

from plateau.metric import Half, View, VisibleDifferences
from plateau.metric.cvvdp import ColorVideoVDP, Display, mirrored, video_jod
from plateau.metric.noise_model import noise_model
from plateau.metric.quality import display_of
from plateau.metric.shots import ShotQuality, frame_weights, samples_needed, shot_quality
from tests.support.images import PAPER

EYE = ColorVideoVDP(Display(pixels_per_degree=20, peak=100, transfer="relative"))
METRIC = VisibleDifferences(PAPER)
FPS, FRAMES = 24, 10


def moving(speed=2):
    """A shot of a smooth pattern and an edge, which move by some pixels a frame."""
    y, x = np.mgrid[0:72, 0:96] / 96
    light = 0.3 + 0.2 * np.sin(12 * x + 3 * y)[..., None] * np.array([1, 0.8, 0.6])
    light[20:50, 30:60] += 0.25
    return np.stack([np.roll(light, speed * f, axis=1) for f in range(FRAMES)]).astype(np.float32)


def halves_of(truth, deviation, *, standing=False, seed=3):
    """Two shots with noise of this deviation each, which changes in every frame or stands still."""
    shape = (2, 1, *truth.shape[1:]) if standing else (2, *truth.shape)
    noise = np.random.default_rng(seed).normal(0, deviation, shape).astype(np.float32)
    return truth + noise


def models(even, odd):
    return [
        noise_model(METRIC, (one + other) / 2, (Half(one, 8), Half(other, 8)))
        for one, other in zip(even, odd, strict=True)
    ]


def true_jod(truth, shot):
    ours, theirs = EYE.video(FPS), EYE.video(FPS)
    before = mirrored(FPS, FRAMES)
    frames = [
        EYE.compare(ours.percept(truth[frame]), theirs.percept(shot[frame]))
        for frame in (*before, *range(FRAMES))
    ]
    return video_jod(frames[len(before) :])


@pytest.mark.parametrize("standing", [False, True])
@pytest.mark.parametrize("deviation", [0.05, 0.1, 0.2])
def test_the_estimate_is_near_the_truth(deviation, standing):
    truth = moving()
    even, odd = halves_of(truth, deviation, standing=standing)
    lost = 10 - true_jod(truth, (even + odd) / 2)
    assert 10 - shot_quality(EYE, FPS, models(even, odd)).jod == pytest.approx(lost, rel=0.05)


@pytest.mark.parametrize("speed", [0, 1, 7])
def test_movement_costs_nothing(speed):
    shot = moving(speed)
    assert shot_quality(EYE, FPS, models(shot, shot)).jod == 10


def test_the_frame_with_the_most_noise_is_the_worst_one():
    truth = moving()
    even, odd = halves_of(truth, 0.02)
    even[4] += 5 * (even[4] - truth[4])
    frames = shot_quality(EYE, FPS, models(even, odd)).frames
    assert len(frames) == FRAMES
    assert 4 <= np.argmin(frames) <= 4 + 3  # an eighth of a second


def test_the_first_frames_are_about_as_good_as_the_others():
    truth = moving()
    frames = shot_quality(EYE, FPS, models(*halves_of(truth, 0.1))).frames
    assert max(frames) - min(frames) < 0.3 < 10 - max(frames)


def test_the_heat_map_shows_where_the_noise_is():
    truth = moving()
    even, odd = halves_of(truth, 0.05)
    even[:, :, :48], odd[:, :, :48] = truth[:, :, :48], truth[:, :, :48]
    quality = shot_quality(EYE, FPS, models(even, odd), heat=True)
    assert quality.heat.shape == (72, 96)
    assert quality.heat[:, 60:].mean() > 20 * quality.heat[:, :36].mean()
    assert shot_quality(EYE, FPS, models(even, odd)).heat is None


def test_the_least_that_is_likely_is_below_the_estimate():
    even, odd = halves_of(moving(), 0.05)
    quality = shot_quality(EYE, FPS, models(even, odd))
    assert 6 < quality.low_jod < quality.jod < 10
    assert all(low < jod for low, jod in zip(quality.low_frames, quality.frames, strict=True))


def test_a_view_is_what_is_seen():
    """By its exposure twice the light, and twice the noise, which whoever looks at it sees more."""
    even, odd = halves_of(moving(), 0.02)
    dark, bright = (
        shot_quality(ColorVideoVDP(display_of(view, 96)), FPS, models(even, odd), view=view)
        for view in (View(exposure_ev=-3), View(exposure_ev=0))
    )
    assert dark.jod > bright.jod


def quality_of(lows):
    return ShotQuality(9.0, 8.9, tuple(lows), tuple(lows))


@pytest.mark.parametrize("fps", [1, 12, 24, 60])
def test_each_frame_is_seen_at_some_moment_and_each_moment_has_frames(fps):
    for frames in (2, 3, 7, 30):
        weights = frame_weights(fps, frames)
        assert weights.shape == (frames, frames)
        assert (weights >= 0).all()
        assert weights.sum(axis=1) == pytest.approx(weights.sum(axis=1)[0])
        # Whatever moment is bad, somebody is asked for more, and no more than twice as much
        for moment in range(frames):
            lows = [9.8] * frames
            lows[moment] = 9.0
            needed = samples_needed(quality_of(lows), fps, 9.5, [100] * frames)
            assert max(needed) == 200
            assert min(needed) >= 100
        # Whatever frame is there, it is asked where all moments are bad
        needed = samples_needed(quality_of([9.4] * frames), fps, 9.5, [100] * frames)
        assert np.allclose(needed, 144)


def test_frames_of_good_moments_keep_what_they_have():
    lows = [9.8] * 24
    lows[12] = 9.3
    needed = samples_needed(quality_of(lows), FPS, 9.5, range(100, 124))
    asked = [frame for frame, one in enumerate(needed) if one > 100 + frame]
    assert asked == [8, 9, 10]  # an eighth of a second before
    assert needed[9] == pytest.approx(109 * (0.7 / 0.5) ** 2)


def test_pixels_that_are_not_finite_count_as_equal():
    shot = moving()
    even = shot.copy()
    even[2, 5, 5] = np.nan
    assert shot_quality(EYE, FPS, models(even, shot)).jod == 10


def test_a_shot_that_cannot_be_judged():
    with pytest.raises(ValueError, match="without frames"):
        shot_quality(EYE, FPS, [])
    shot = moving()
    frames = [*models(shot, shot), *models(shot[:1, :, :90], shot[:1, :, :90])]
    with pytest.raises(ValueError, match="frame 16 of a video has 90×72 pixels"):
        shot_quality(EYE, FPS, frames)
