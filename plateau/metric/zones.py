"""A judgement by zones of the image, because the eye's threshold varies across it."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Zones begin at multiples of this many pixels, so that renderers can crop to them.
ZONE_ALIGNMENT = 16
#: Rows and columns of zones; others took observers' thresholds in 4 × 4 zones.
ZONES = (4, 4)


def zone_edges(size: int, zones: int) -> list[int]:
    """Return the starts of the zones of a line of pixels, and the end of the last zone.

    The line consists of blocks of 16 pixels; the last block may be shorter. All zones have the same
    number of blocks, or one more. A line with fewer blocks than `zones` has one zone per block.

    Raises
    ------
    ValueError
        If there is no pixel or no zone.

    Examples
    --------
    >>> zone_edges(512, 4)
    [0, 128, 256, 384, 512]
    >>> zone_edges(1080, 4)
    [0, 272, 544, 816, 1080]
    >>> zone_edges(24, 4)
    [0, 16, 24]
    """
    if size < 1 or zones < 1:
        raise ValueError(f"{size} pixels cannot be cut into {zones} zones")
    blocks = -(-size // ZONE_ALIGNMENT)
    zones = min(zones, blocks)
    starts = [blocks * zone // zones * ZONE_ALIGNMENT for zone in range(zones)]
    return [*starts, size]


def zone_fractions(visible: NDArray[Any], grid: tuple[int, int] = ZONES) -> NDArray[np.float64]:
    """Return the visible fraction of each zone, (rows, columns) float64 in [0, 1].

    Parameters
    ----------
    visible
        A map of visible pixels, (H, W): bool like `Difference.visible`, or shares in [0, 1] like
        `Estimate.visible`.
    grid
        Rows and columns of zones; see `zone_edges` for sizes that they do not divide.

    Raises
    ------
    ValueError
        If the map is not (H, W), or there is no zone.

    Examples
    --------
    >>> visible = np.zeros((32, 64), bool)
    >>> visible[:8, :16] = True
    >>> zone_fractions(visible, (2, 2)).tolist()
    [[0.25, 0.0], [0.0, 0.0]]
    """
    if visible.ndim != 2:
        raise ValueError(f"a map must have shape (H, W), not {visible.shape}")
    rows, columns = (zone_edges(*pair) for pair in zip(visible.shape, grid, strict=True))
    fractions: NDArray[np.float64] = np.array(
        [
            [
                visible[top:bottom, left:right].mean(dtype=np.float64)
                for left, right in pairwise(columns)
            ]
            for top, bottom in pairwise(rows)
        ]
    )
    return fractions
