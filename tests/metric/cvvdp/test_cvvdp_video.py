"""ColorVideoVDP on videos: the authors' numbers on 30, and what a user of it relies on."""

import json
import tracemalloc

import numpy as np
import pytest

from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP, Display, mirrored, video_jod
from tests.support.images import video_goldens
from tests.support.images.quality_goldens import DISPLAYS as GOLDEN_DISPLAYS

ROWS = json.loads(video_goldens.VIDEOS.read_text())
NEAR = ColorVideoVDP(DISPLAYS["standard_fhd"])


def compared(model, reference, test, fps, **options):
    ours, theirs = model.video(fps), model.video(fps)
    return [
        model.compare(ours.percept(one), theirs.percept(other), **options)
        for one, other in zip(reference, test, strict=True)
    ]


def test_the_authors_numbers_with_a_mirrored_start():
    for row in ROWS:
        model = ColorVideoVDP(Display(**GOLDEN_DISPLAYS[row["display"]]))
        fps, videos = video_goldens.fps_of(row["video"]), video_goldens.videos(row["video"])
        before = mirrored(fps, len(videos[0]))
        order = [*before, *range(len(videos[0]))]
        frames = compared(model, *(video[order] for video in videos), fps)
        assert video_jod(frames[len(before) :]) == pytest.approx(row["mirrored"], abs=0.001)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['video']} {row['display']}")
def test_the_authors_numbers(row):
    name = row["video"]
    model = ColorVideoVDP(Display(**GOLDEN_DISPLAYS[row["display"]]))
    frames = compared(model, *video_goldens.videos(name), video_goldens.fps_of(name), heat=True)
    assert video_jod(frames) == pytest.approx(row["jod"], abs=0.001)
    heat = [frame.heat.mean() for frame in frames]
    assert heat == pytest.approx(row["mean_heat"], rel=0.01, abs=1e-4)


def test_noise_that_moves_is_judged_otherwise_than_noise_that_stands():
    reference = np.full((12, 48, 64, 3), 0.4, np.float32)
    noise = np.random.default_rng(4).normal(0, 0.05, reference.shape).astype(np.float32)
    moving = compared(NEAR, reference, (reference + noise).clip(0, 1), 24)
    standing = compared(NEAR, reference, (reference + noise[0]).clip(0, 1), 24)
    achromatic, _, _, transient = np.mean([one.differences for one in moving], axis=0).max(axis=1)
    still, _, _, still_transient = np.mean([one.differences for one in standing], axis=0).max(
        axis=1
    )
    assert achromatic < still
    assert still_transient < transient / 100


def test_a_standing_video_has_the_same_quality_in_every_frame():
    reference, test = video_goldens.videos("still disks ghost 45x80 24 at 60")
    frames = compared(NEAR, reference, test, 60)
    assert len({frame.jod for frame in frames}) < 3  # the sum begins elsewhere in the window
    assert video_jod(frames) == pytest.approx(frames[0].jod, abs=1e-4)


def test_memory_does_not_grow_with_the_video():
    frame = np.full((64, 64, 3), 0.4, np.float32)

    def peak(count):
        tracemalloc.start()
        compared(NEAR, [frame] * count, [frame] * count, 24)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(1)  # compiles
    assert peak(60) < peak(10) + 10 * frame.nbytes  # of fifty more, each in two videos


def test_videos_that_cannot_be_judged():
    frame = np.full((8, 8, 3), 0.5, np.float32)
    for fps in (0, -24, 1e9, float("nan")):
        with pytest.raises(ValueError, match="fps must be a number from 1 to 480"):
            NEAR.video(fps)
    video = NEAR.video(24)
    first = video.percept(frame)
    with pytest.raises(ValueError, match="frame 1 of a video has 9×8 pixels, the first 8×8"):
        video.percept(np.full((8, 9, 3), 0.5))
    with pytest.raises(ValueError, match="a frame at 24 fps as the reference met a still"):
        NEAR.compare(first, NEAR.percept(frame))
    with pytest.raises(ValueError, match="met a frame at 30 fps"):
        NEAR.compare(first, NEAR.video(30).percept(frame))
    with pytest.raises(ValueError, match="finite in every pixel"):
        video.percept(frame * np.nan)
    with pytest.raises(ValueError, match="a video without frames"):
        video_jod([])
