"""The pass over an image: prepare a row of each side, compare the rows, and repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from plateau.metric.compiled import elevation, threshold
from plateau.metric.compiled.jit import entry_point, kernel
from plateau.metric.compiled.levels import A_STAR, B_STAR, DELAY, SLICE, make_row
from plateau.metric.pyramid import LEVELS
from plateau.metric.vdp import BANDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from plateau.metric.compiled.elevation import Eye
    from plateau.metric.compiled.levels import Side
    from plateau.metric.compiled.light import KernelView
    from plateau.metric.display import Mask, Plane

_COLOURS_AND_RESPONSES = 6

# Quantities of a pixel: rows of a slice's space, and of the queue of open pixels.
_ADAPTED, _STRENGTH, _CONTRASTS, _BAND = 0, 1, 2, 3
_KNOWN = _BAND + BANDS
# Further rows of the space.
_PER_THRESHOLD, _LEAST, _SCALE, _DECAY, _MASKED = range(_KNOWN, _KNOWN + 5)
_SPACES = _KNOWN + 5


@entry_point
def prepare(side: Side, screen: KernelView) -> int:
    """Fill rings of the image's height; return how many pixels are not finite."""
    work = np.empty((_COLOURS_AND_RESPONSES, SLICE), np.float32)
    non_finite = 0
    for n in range(side.image.shape[0] + DELAY):
        non_finite += make_row(side, n, screen, work)
    return non_finite


@entry_point
def sweep(
    reference: Side,
    test: Side,
    reference_streams: bool,
    test_streams: bool,
    screen: KernelView,
    eye: Eye,
    visible: Mask,
) -> tuple[int, int]:
    """Write the map of visible pixels, without those that are not finite.

    A side that streams is computed from its image during the pass, in low rings; any other is kept.
    Returns how many pixels of each streaming side are not finite.
    """
    height, width = visible.shape
    work = np.empty((_COLOURS_AND_RESPONSES, SLICE), np.float32)
    space = np.empty((_SPACES, SLICE), np.float32)
    queue = np.empty((_KNOWN, width), np.float32)
    position = np.empty(width, np.int64)
    flags = np.empty(SLICE, np.uint8)
    in_reference, in_test = 0, 0
    for n in range(height + DELAY):
        if reference_streams:
            in_reference += make_row(reference, n, screen, work)
        if test_streams:
            in_test += make_row(test, n, screen, work)
        y = n - DELAY
        if y >= 0:
            _compare_row(
                reference.planes, test.planes, y, eye, visible[y], space, queue, position, flags
            )
    return in_reference, in_test


@kernel
def _compare_row(
    ours: Plane,
    theirs: Plane,
    y: int,
    eye: Eye,
    visible: NDArray[np.bool_],
    space: Plane,
    queue: Plane,
    position: NDArray[np.int64],
    flags: NDArray[np.uint8],
) -> None:
    """Decide all pixels that need no masking, queue the others, and decide those."""
    our_slot, their_slot = y % ours.shape[1], y % theirs.shape[1]
    width = visible.size
    queued = 0
    for start in range(0, width, SLICE):
        count = min(SLICE, width - start)
        end = start + count

        # The strength of the difference decides if it is outside the range of the elevation.
        _strength(ours, theirs, our_slot, their_slot, start, end, eye, space)
        if elevation.decide_by_range(space[_STRENGTH], visible[start:end], count) == 0:
            continue

        # The contrasts decide if the elevation hides the difference even without masking.
        for band in range(BANDS):
            elevation.contrast(
                ours[band, our_slot, start:end],
                ours[band + 1, our_slot, start:end],
                ours[band + 2, our_slot, start:end],
                theirs[band, their_slot, start:end],
                theirs[band + 1, their_slot, start:end],
                theirs[band + 2, their_slot, start:end],
                space[_BAND + band],
                count,
            )
        c0, c1, c2 = space[_BAND], space[_BAND + 1], space[_BAND + 2]
        c3, c4, c5 = space[_BAND + 3], space[_BAND + 4], space[_BAND + 5]
        elevation.total(c0, c1, c2, c3, c4, c5, space[_CONTRASTS], count)
        elevation.weighted_total(c0, c1, c2, c3, c4, c5, eye.weights, space[_LEAST], count)
        elevation.find_open(space[_STRENGTH], space[_CONTRASTS], space[_LEAST], flags, count)
        queued = _enqueue(space, flags, start, count, queue, position, queued)

    # Masking decides the rest.
    for start in range(0, queued, SLICE):
        count = min(SLICE, queued - start)
        end = start + count
        scale, decay, masked = space[_SCALE], space[_DECAY], space[_MASKED]
        elevation.sensitivity(queue[_ADAPTED, start:end], eye.decay_rate, scale, decay, count)
        masked[:] = np.float32(0)
        for finer in range(BANDS):
            band = BANDS - 1 - finer
            weight, frequency = eye.weights[band], eye.squared_frequencies[band]
            contrast = queue[_BAND + band, start:end]
            elevation.add_masked(contrast, weight, frequency, scale, decay, masked, count)
        strength, contrasts = queue[_STRENGTH, start:end], queue[_CONTRASTS, start:end]
        elevation.decide(strength, contrasts, masked, flags, count)
        for i in range(count):
            visible[position[start + i]] = flags[i] != 0


@kernel
def _strength(
    ours: Plane,
    theirs: Plane,
    our_slot: int,
    their_slot: int,
    start: int,
    end: int,
    eye: Eye,
    space: Plane,
) -> None:
    """Write the adaptation luminance and the strength of a slice's differences."""
    count = end - start
    level = eye.adaptation_level
    adapted, per_threshold, strength = space[_ADAPTED], space[_PER_THRESHOLD], space[_STRENGTH]
    threshold.adaptation(
        ours[level, our_slot, start:end], theirs[level, their_slot, start:end], adapted, count
    )
    threshold.per_threshold(adapted, per_threshold, count)
    threshold.luminance_strength(
        ours[0, our_slot, start:end],
        theirs[0, their_slot, start:end],
        per_threshold,
        strength,
        count,
    )
    if ours.shape[0] > LEVELS:
        threshold.add_colour(
            ours[A_STAR, our_slot, start:end],
            ours[B_STAR, our_slot, start:end],
            theirs[A_STAR, their_slot, start:end],
            theirs[B_STAR, their_slot, start:end],
            adapted,
            strength,
            count,
        )


@kernel
def _enqueue(
    space: Plane,
    open_: NDArray[np.uint8],
    start: int,
    count: int,
    queue: Plane,
    position: NDArray[np.int64],
    queued: int,
) -> int:
    """Add a slice's open pixels to the row's queue; return its length."""
    first = queued
    # Every pixel is written and only open ones advance: no branch to mispredict.
    for i in range(count):
        position[queued] = start + i
        queued += open_[i]
    for known in range(_KNOWN):
        source, target = space[known], queue[known]
        for j in range(first, queued):
            target[j] = source[position[j] - start]
    return queued
