"""Reads a picture of where people look as the weights of a job's focus."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plateau.errors import CommandFailed
from plateau.farm.images.exr import decode_image
from plateau.farm.images.png import decode_png
from plateau.farm.model.spec.view import MOST_FOCUS


def focus_of(path: Path) -> list[list[float]]:
    """Return the weights of a PNG or an EXR: its grey values, averaged to as few as a focus has.

    The greatest is 1; all are rounded to thousandths.

    Raises
    ------
    CommandFailed
        The file cannot be read, or it is black, or it has values that are negative or not finite.
    """
    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".png":
            colour = decode_png(content).colour
        else:
            colour = decode_image(content)
    except (OSError, ValueError) as error:
        raise CommandFailed(f"the focus {path} cannot be read: {error}") from error
    grey: NDArray[np.float64] = colour.mean(axis=-1, dtype=np.float64)
    if not np.isfinite(grey).all() or (grey < 0).any():
        raise CommandFailed(f"the focus {path} has pixels that are negative, NaN or infinite")
    if not grey.any():
        raise CommandFailed(f"the focus {path} is black: nobody would look at any pixel")
    weights = _averaged(_averaged(grey).T).T
    found: list[list[float]] = (weights / weights.max()).round(3).tolist()
    return found


def _averaged(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the plane with at most as many rows as a focus, each the mean of its own."""
    rows = min(len(plane), MOST_FOCUS)
    edges = np.arange(rows + 1) * len(plane) // rows
    sums: NDArray[np.float64] = np.add.reduceat(plane, edges[:-1], axis=0)
    return sums / np.diff(edges)[:, np.newaxis]
