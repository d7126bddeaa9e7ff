"""Smooth noise for textures."""

import numpy as np
import numpy.typing as npt


def noise(shape: tuple[int, int], cells: tuple[int, int], seed: int) -> npt.NDArray[np.float64]:
    """Return smooth noise in [0, 1] that repeats at the edges, on a lattice of so many cells."""
    field = np.random.default_rng(seed).random(cells)
    for axis in (0, 1):
        position = np.arange(shape[axis]) * cells[axis] / shape[axis]
        cell = np.floor(position).astype(int)
        part = position - cell
        part = (part * part * (3 - 2 * part)).reshape((-1, 1) if axis == 0 else (1, -1))
        here = np.take(field, cell % cells[axis], axis)
        there = np.take(field, (cell + 1) % cells[axis], axis)
        field = here + part * (there - here)
    return field
