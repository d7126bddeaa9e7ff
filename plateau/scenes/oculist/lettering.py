"""An alphabet of strokes, after Roman capitals, and inscriptions cut with it.

Each letter is a few polylines on a grid of digits: x to the right, y down from 0, the cap line, to
9, the base line. "00-09 04-44" is a stem and an arm.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Field = npt.NDArray[np.float64]
Point = tuple[float, float]

CAP_HEIGHT = 9
_GAP = 3  # between letters, in the units of the grid

_STROKES = {
    " ": "",
    "·": "15-15",
    "A": "09-30-69 16-56",
    "B": "09-00-40-51-53-44-04 44-56-58-49-09",
    "C": "62-50-20-02-07-29-59-67",
    "D": "00-09-39-67-62-30-00",
    "E": "60-00-09-69 04-44",
    "F": "60-00-09 04-44",
    "G": "62-50-20-02-07-29-49-67-65-45",
    "H": "00-09 60-69 04-64",
    "I": "10-19 00-20 09-29",
    "L": "00-09-59",
    "M": "09-10-46-70-89",
    "N": "09-00-69-60",
    "O": "20-40-62-67-49-29-07-02-20",
    "P": "09-00-40-62-63-45-05",
    "Q": "20-40-62-67-49-29-07-02-20 46-79",
    "R": "09-00-40-62-63-45-05 35-69",
    "S": "61-50-20-02-03-65-67-49-19-08",
    "T": "00-60 30-39",
    "V": "00-39-60",
    "X": "00-69 60-09",
    "Y": "00-34-60 34-39",
}


def _strokes(letter: str) -> list[list[Point]]:
    return [
        [(float(point[0]), float(point[1])) for point in stroke.split("-")]
        for stroke in _STROKES[letter].split()
    ]


def advance(letter: str) -> float:
    """Return how far a letter moves the pen, in the units of the grid."""
    points = [point for stroke in _strokes(letter) for point in stroke]
    return max((x for x, _ in points), default=1.0) + _GAP


def length(line: str) -> float:
    """Return the length of a line, in the units of the grid."""
    return sum(advance(letter) for letter in line) - _GAP


def cut(shape: tuple[int, int], lines: Sequence[str], stroke: float, margin: float = 0.06) -> Field:
    """Return how deep an inscription is cut: 0 at the surface, 1 along the middle of a stroke.

    Parameters
    ----------
    shape : (rows, columns)
        Of the field.
    lines : sequence of str
        What it says; every line is set to the full measure, as masons do.
    stroke : float
        Half the width of a V-shaped groove, in the units of the alphabet's grid.
    margin : float
        Left free on each side, as a fraction of the shorter side.

    Returns
    -------
    array (rows, columns) of float64, in [0, 1]
    """
    rows, columns = shape
    field = np.zeros(shape)
    border = margin * min(shape)
    pitch = (rows - 2 * border) / len(lines)
    scale_y = 0.66 * pitch / CAP_HEIGHT
    for number, line in enumerate(lines):
        scale_x = min((columns - 2 * border) / length(line), 1.5 * scale_y)
        pen = (columns - scale_x * length(line)) / 2
        top = border + (number + 0.17) * pitch
        for letter in line:
            for polyline in _strokes(letter):
                placed = [(pen + x * scale_x, top + y * scale_y) for x, y in polyline]
                for start, end in pairwise(placed):
                    _groove(field, start, end, stroke * min(scale_x, scale_y))
            pen += scale_x * advance(letter)
    return field


def _groove(field: Field, start: Point, end: Point, half_width: float) -> None:
    """Cut one straight groove, in pixels, as deep as the deeper of it and what is there."""
    rows, columns = field.shape
    left = max(int(min(start[0], end[0]) - half_width) - 1, 0)
    right = min(int(max(start[0], end[0]) + half_width) + 2, columns)
    top = max(int(min(start[1], end[1]) - half_width) - 1, 0)
    bottom = min(int(max(start[1], end[1]) + half_width) + 2, rows)
    y, x = np.mgrid[top:bottom, left:right] + 0.5
    run_x, run_y = end[0] - start[0], end[1] - start[1]
    length_squared = run_x * run_x + run_y * run_y or 1.0
    along = ((x - start[0]) * run_x + (y - start[1]) * run_y) / length_squared
    along = np.clip(along, 0, 1)
    away_x, away_y = x - start[0] - along * run_x, y - start[1] - along * run_y
    distance = np.sqrt(away_x * away_x + away_y * away_y)
    window = field[top:bottom, left:right]
    np.maximum(window, np.clip(1 - distance / half_width, 0, 1), out=window)
