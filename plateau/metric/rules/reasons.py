"""Phrases that the reasons of several rules share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from plateau.metric.rules.evidence import Evidence


def darkness(evidence: Evidence) -> str | None:
    """Return a phrase for an image too dark for visible noise; None for a brighter one."""
    from plateau.metric.vdp import COLOUR_LUMINANCE

    level = evidence.metric.adaptation_level(evidence.percept.shape[1])
    brightest = float(evidence.percept.levels[level].max())
    if brightest >= COLOUR_LUMINANCE:
        return None
    return f"the image is so dark (at most {brightest:.3g} cd/m²) that its noise cannot be seen"


def counted(pixels: float) -> str:
    """Return a number of pixels in words: halves below ten, whole numbers above.

    It rounds like `plateau.farm.wire.figures.pixels`, which it must not import: see its test.

    Examples
    --------
    >>> counted(0), counted(1), counted(2.5), counted(232.5), counted(1234)
    ('no pixel', '1 pixel', '2.5 pixels', '233 pixels', '1,234 pixels')
    """
    if pixels == 0:
        return "no pixel"
    if pixels == 1:
        return "1 pixel"
    return f"{math.floor(pixels + 0.5):,} pixels" if pixels >= 10 else f"{pixels:.2g} pixels"


def left_out(non_finite: float) -> str:
    """Return a phrase about pixels that are not finite, empty if there are none.

    Examples
    --------
    >>> left_out(0), left_out(1)
    ('', '; 1 pixel that is NaN or infinite is left out')
    """
    if not non_finite:
        return ""
    verb = "is" if non_finite == 1 else "are"
    return f"; {counted(non_finite)} that {verb} NaN or infinite {verb} left out"
