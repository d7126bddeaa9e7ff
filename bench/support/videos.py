"""Videos beside their references, as a person sees them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from plateau.metric.cvvdp import mirrored

if TYPE_CHECKING:
    from collections.abc import Callable

    from plateau.metric import Image
    from plateau.metric.cvvdp import ColorVideoVDP, Quality


def seen_beside(
    eye: ColorVideoVDP, fps: float, frames: int, pair: Callable[[int], tuple[Image, Image]]
) -> tuple[list[Quality], list[Quality]]:
    """Return what is seen of a video, frame by frame, as if it were mirrored before it begins.

    Parameters
    ----------
    eye, fps, frames
        Who sees it, and how many frames it has in a second and in all.
    pair : callable of int
        The frame of the reference and that of the video, (height, width, 3), by its number.

    Returns
    -------
    before, seen : list of Quality
        Of the mirrored frames, and of the video.
    """
    reference, test = eye.video(fps), eye.video(fps)
    before = mirrored(fps, frames)
    seen = []
    for frame in (*before, *range(frames)):
        truth, image = pair(frame)
        seen.append(eye.compare(reference.percept(truth), test.percept(image)))
    return seen[: len(before)], seen[len(before) :]
