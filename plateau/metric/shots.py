"""The quality of a shot in JOD, estimated frame after frame without converged frames.

As in `plateau.metric.estimate`, T, a frame without its noise, stands for the converged frame, and
N, noise like the frame's own, for its error. ColorVideoVDP compares the video of all T with those
of T + N and T - N. All of them move alike, so movement costs nothing. Noise that differs from frame
to frame flickers in N as it does in the shot, and noise that stands still stands still in N. Before
the first frame come those that follow it, mirrored, as noise would otherwise stand still there.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plateau.metric.blend import BlendError
from plateau.metric.cvvdp import ColorVideoVDP, Quality, mirrored, video_jod
from plateau.metric.cvvdp.video import Video, temporal_filters
from plateau.metric.display import Plane, View, displayed
from plateau.metric.noise_model import NoiseModel
from plateau.metric.quality import BEST_JOD, FIRST_POWER, MODEL_ERROR

#: A frame is seen at a moment if it has this share of the weight of the frame that has the most.
_SEEN = 0.5
#: The most by which `samples_needed` multiplies samples at once, as its forecast is a rough one.
MOST_GROWTH = 2.0


@dataclass(frozen=True, eq=False)
class ShotQuality:
    """The quality of a shot against the converged one, as estimated."""

    #: 10 where nobody sees an error; one less where three of four prefer the converged shot.
    jod: float
    #: It is at least this in about nine cases of ten.
    low_jod: float
    #: What the shot would have if all of its moments were as this one; there is one for each frame.
    #: The eye answers an eighth of a second late, so an error is seen that many frames after the
    #: one that has it. In the first quarter of a second mirrored frames repeat their noise, and
    #: each moment has the quality of the first one after that.
    frames: tuple[float, ...]
    #: Each is at least this in about nine cases of ten.
    low_frames: tuple[float, ...]
    #: Where a person would see the noise, (H, W) float32, the mean over the frames of what is lost
    #: there, over 10 JOD; None unless asked for.
    heat: Plane | None = field(default=None, repr=False)


def shot_quality(
    eye: ColorVideoVDP,
    fps: float,
    models: Sequence[NoiseModel | BlendError],
    *,
    view: View | None = None,
    heat: bool = False,
) -> ShotQuality:
    """Return the quality of a shot, the mean of those of T + N and T - N.

    Parameters
    ----------
    eye
        ColorVideoVDP, for a display whose transfer fits the frames: `relative` for radiance.
    fps
        Frames per second, from 1 to 480.
    models
        The noise model of each frame, in order; of a denoised frame the error of its blend, whose
        greatest counts for what the shot surely has. A sequence that makes its items when asked has
        one in memory at a time. The same halves of the slices have to make the noise of all frames,
        so that it is as alike from frame to frame as the shot's. Non-finite pixels count as equal.
    view
        As the frames are displayed; by default they are as the display shows them.
    heat
        Whether to map where the noise is seen.

    Raises
    ------
    ValueError
        If there are no frames, if they differ in size, or if the display cannot show them.

    Examples
    --------
    >>> from plateau.metric import Half, View, VisibleDifferences
    >>> from plateau.metric.cvvdp import ColorVideoVDP, Display
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
    clean, noisy = eye.video(fps), defaultdict[_Side, Video](lambda: eye.video(fps))
    before = mirrored(fps, len(models))
    seen = defaultdict[_Side, list[Quality]](list)
    total: Plane | None = None
    for number, place in enumerate((*before, *range(len(models)))):
        sides = _sides(models[place])
        image = next(iter(sides.values())).clean
        reference = clean.percept(image if view is None else displayed(image, view))
        for side, model in sides.items():
            image = model.finite_noisy(side.amount)
            percept = noisy[side].percept(image if view is None else displayed(image, view))
            if number < len(before):
                continue
            quality = eye.compare(reference, percept, heat=heat and not side.is_greatest)
            if quality.heat is not None:
                total = quality.heat if total is None else total + quality.heat
            seen[side].append(Quality(quality.jod, quality.differences, None))
    jods = {side: video_jod(qualities) for side, qualities in seen.items()}
    moments = [
        {side: qualities[moment].jod for side, qualities in seen.items()}
        for moment in _whole_moments(len(before), len(models))
    ]
    return ShotQuality(
        jod=_likely(jods),
        low_jod=_at_least(jods),
        frames=tuple(map(_likely, moments)),
        low_frames=tuple(map(_at_least, moments)),
        heat=None if total is None else total / np.float32(2 * len(models)),
    )


class _Side(NamedTuple):
    """A video that is compared with that of all T."""

    is_greatest: bool  #: whether its noise is the greatest that is possible, or what is likely
    amount: float  #: 1 for T + N, -1 for T - N


def _sides(found: NoiseModel | BlendError) -> dict[_Side, NoiseModel]:
    models = (found,) if isinstance(found, NoiseModel) else (found.likely, found.greatest)
    return {
        _Side(is_greatest, amount): model
        for is_greatest, model in zip((False, True), models, strict=False)
        for amount in (1.0, -1.0)
    }


def _likely(jods: Mapping[_Side, float]) -> float:
    return sum(jod for side, jod in jods.items() if not side.is_greatest) / 2


def _at_least(jods: Mapping[_Side, float]) -> float:
    return BEST_JOD - (BEST_JOD - min(jods.values())) * (1 + MODEL_ERROR)


def _whole_moments(before: int, frames: int) -> list[int]:
    """Return for each moment itself, or the first one of which the eye has no mirrored frame."""
    first = before if frames > before else 0
    return [max(moment, first) for moment in range(frames)]


def frame_weights(fps: float, frames: int) -> NDArray[np.float64]:
    """Return how much the eye sees of each frame at each moment of a shot, (moments, frames).

    Parameters
    ----------
    fps
        Frames per second, from 1 to 480.
    frames
        How many frames the shot has, 1 or more. It has as many moments.

    Notes
    -----
    At a moment the eye has the frames of the last quarter of a second, by the weights of the
    luminance's sustained channel; in the first quarter of a second as at the first moment after it.

    Examples
    --------
    >>> frame_weights(24, 12)[8].argmax()
    np.int64(5)
    """
    taps = np.abs(temporal_filters(fps)[0]).astype(np.float64)
    before = mirrored(fps, frames)
    shown = np.array([*before, *range(frames)])
    weights = np.zeros((frames, frames))
    for row, moment in zip(weights, _whole_moments(len(before), frames), strict=True):
        np.add.at(row, shown[moment : moment + len(taps)], taps)
    return weights


def samples_needed(
    quality: ShotQuality, fps: float, target: float, spp: Sequence[int]
) -> tuple[float, ...]:
    """Return the samples per pixel that each frame needs next, so that no moment is too noisy.

    Those of a frame that is seen at good moments alone are its own. They are `MOST_GROWTH` times
    its own at most, so that a forecast which is too high costs little.

    Parameters
    ----------
    quality
        Of the shot as it is.
    fps
        Frames per second, from 1 to 480.
    target
        The quality that each moment is to have at least, in JOD.
    spp
        The samples per pixel of each frame.

    Notes
    -----
    What is lost falls about as the noise does, as 1 / √n. So a moment at which L is lost and at
    most A may be needs (L / A)² times the samples in the frames that are seen most there: those
    with half of the weight or more of the one that has the most.

    Examples
    --------
    >>> quality = ShotQuality(9.2, 9.1, (9.6,) * 9 + (8.9,) * 3, (9.5,) * 9 + (8.8,) * 3)
    >>> needed = samples_needed(quality, 24, 9.5, [100] * 12)
    >>> needed[:5], max(needed)
    ((100.0, 100.0, 100.0, 100.0, 100.0), 200.0)
    """
    lost = BEST_JOD - np.array(quality.low_frames)
    growth = np.clip((lost / (BEST_JOD - target)) ** (1 / FIRST_POWER), 1, MOST_GROWTH)
    weights = frame_weights(fps, len(spp))
    seen = weights >= _SEEN * weights.max(axis=1, keepdims=True)
    seen[weights.argmax(axis=0), np.arange(len(spp))] = True  # the last frames are seen late
    return tuple((np.where(seen, growth[:, np.newaxis], 1).max(axis=0) * spp).tolist())
