"""The quality of a shot in JOD, estimated frame after frame without converged frames.

As in `plateau.metric.estimate`, T, a frame without its noise, stands for the converged frame, and
N, noise like the frame's own, for its error. ColorVideoVDP compares the video of all T with those
of T + N and T - N. All of them move alike, so movement costs nothing. Noise that differs from frame
to frame flickers in N as it does in the shot, and noise that stands still stands still in N. Before
the first frame come those that follow it, mirrored, as noise would otherwise stand still there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from plateau.metric.cvvdp import ColorVideoVDP, mirrored, video_jod

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plateau.metric.cvvdp import Quality
    from plateau.metric.noise_model import NoiseModel


@dataclass(frozen=True)
class ShotQuality:
    """The quality of a shot against the converged one, as estimated."""

    #: 10 where nobody sees an error; one less where three of four prefer the converged shot.
    jod: float
    #: What the shot would have if each of its frames were as this one. The eye answers an eighth of
    #: a second late, so an error is seen that many frames after the one that has it.
    frames: tuple[float, ...]


def shot_quality(eye: ColorVideoVDP, fps: float, models: Sequence[NoiseModel]) -> ShotQuality:
    """Return the quality of a shot, the mean of those of T + N and T - N.

    Parameters
    ----------
    eye
        ColorVideoVDP, for a display whose transfer fits the frames: `relative` for radiance.
    fps
        Frames per second, from 1 to 480.
    models
        The noise model of each frame, in order. A sequence that makes its items when asked has one
        in memory at a time. The same halves of the slices have to make the noise of all frames, so
        that it is as alike from frame to frame as the shot's. Pixels that are not finite count as
        equal.

    Raises
    ------
    ValueError
        If there are no frames, if they differ in size, or if the display cannot show them.

    Examples
    --------
    >>> import numpy as np
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> from plateau.metric.cvvdp import Display
    >>> from plateau.metric.noise_model import noise_model
    >>> eye = ColorVideoVDP(Display(pixels_per_degree=20, transfer="relative"))
    >>> noise = np.random.default_rng(1).normal(0, 0.05, (6, 2, 64, 64, 3)).astype(np.float32)
    >>> models = [
    ...     noise_model(
    ...         VisibleDifferences(View()), (even + odd) / 2, (Half(even, 50), Half(odd, 50))
    ...     )
    ...     for even, odd in np.float32(0.4) + noise
    ... ]
    >>> 6 < shot_quality(eye, 24, models).jod < 8
    True
    """
    if not models:
        raise ValueError("a shot without frames has no quality")
    clean, above, below = (eye.video(fps) for _ in range(3))
    one: list[Quality] = []
    other: list[Quality] = []
    before = mirrored(fps, len(models))
    for place in (*before, *range(len(models))):
        model = models[place]
        reference = clean.percept(model.clean)
        for amount, video, qualities in ((1.0, above, one), (-1.0, below, other)):
            percept = video.percept(model.finite_noisy(amount))
            qualities.append(eye.compare(reference, percept))
    one, other = one[len(before) :], other[len(before) :]
    return ShotQuality(
        jod=(video_jod(one) + video_jod(other)) / 2,
        frames=tuple((up.jod + down.jod) / 2 for up, down in zip(one, other, strict=True)),
    )
