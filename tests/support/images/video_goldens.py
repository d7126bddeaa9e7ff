"""Videos made by code, and what the authors' ColorVideoVDP says of them.

`python -m tests.support.images.video_goldens` records `tests/reference/quality/videos.json` anew,
where `cvvdp` 0.5.7 is installed; it takes half a minute. Frames are multiples of 1/255, so that
every machine has the same.
"""

import json

import numpy as np

from tests.support.images.quality_goldens import STILLS, authors_model, made, rounded, write_rows

VIDEOS = STILLS.with_name("videos.json")

CHANGES = [
    *("noise", "screen-door", "flicker", "tint", "stutter", "blur", "fireflies", "ghost"),
    *("fade", "cut"),
]


def fps_of(name):
    """Return the frames per second of the video of this name."""
    return float(name.split()[-1])


def videos(name):
    """Return the reference and the test video of this name, (F, H, W, 3) float32 in [0, 1]."""
    motion, scene, change, size, frames, _, _ = name.split()
    height, width = (int(number) for number in size.split("x"))
    count = int(frames)
    rng = np.random.default_rng([CHANGES.index(change), height, width, count])
    image = made(scene, height, width, rng)
    time = np.arange(count)[:, None, None, None] / count
    if motion == "moving":
        reference = np.stack([np.roll(image, 2 * frame, axis=1) for frame in range(count)])
    else:
        reference = image * (0.1 + 0.9 * time if motion == "fading" else np.ones_like(time))
    reference = rounded(reference)
    return reference, rounded(_changed(reference, change, time, rng))


def _changed(video, change, time, rng):
    odd = np.arange(len(video))[:, None, None, None] % 2
    if change == "noise":
        return video + 0.15 * (rng.random(video.shape) - 0.5)
    if change == "screen-door":
        return video + 0.15 * (rng.random(video.shape[1:]) - 0.5)
    if change == "flicker":
        return video * (1 + 0.08 * (odd - 0.5))
    if change == "tint":
        return video * (1 + 0.1 * odd * np.array([1, 0, -1]))
    if change == "stutter":
        return video[2 * (np.arange(len(video)) // 2)]
    if change == "blur":
        for axis in (1, 2):
            video = (np.roll(video, 1, axis) + video + np.roll(video, -1, axis)) / 3
        return video
    if change == "fireflies":
        return np.where(rng.random((*video.shape[:3], 1)) < 0.002, 1, video)
    if change == "ghost":
        return 0.7 * video + 0.3 * np.roll(video, 3, axis=2)
    if change == "fade":
        return video * (1 - 0.3 * time)
    return np.where(time < 0.5, video, 0.9 * video)  # cut


def _record():
    rows = json.loads(VIDEOS.read_text())
    for row in rows:
        name = row["video"]
        reference, test = videos(name)
        model = authors_model(row["display"])
        about = {"dim_order": "FHWC", "frames_per_second": fps_of(name)}
        jod, about_it = model.predict(test, reference, **about)
        heat = about_it["heatmap"].float().mean(dim=(0, 1, 3, 4)).tolist()
        model.temp_padding, model.do_heatmap = "symmetric", False
        mirrored, _ = model.predict(test, reference, **about)
        row |= {"jod": float(jod), "mirrored": float(mirrored)}
        row["mean_heat"] = [round(mean, 5) for mean in heat]
    write_rows(rows, VIDEOS)


if __name__ == "__main__":
    _record()
