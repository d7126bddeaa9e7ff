"""A curve as CSV, the same from the API and from `plateau judge`."""

from itertools import chain
from typing import Final

from plateau.farm.model.job import CurvePoint
from plateau.farm.wire.csv_text import csv_text

FIGURES: Final = tuple(
    name for name in CurvePoint.model_fields if name not in {"rules", "non_finite_pixels", "at"}
)


def curve_csv(points: list[CurvePoint]) -> str:
    """The points as CSV: the figures, the time, then each rule's value and verdict."""
    rules = sorted({name for point in points for name in point.rules})
    header = [*FIGURES, "non_finite_pixels", "at"]
    rows = [[*header, *chain(*((f"{rule}_value", f"{rule}_stop") for rule in rules))]]
    for point in points:
        row = [*(getattr(point, name) for name in header[:-1]), point.at.isoformat()]
        for rule in rules:
            said = point.rules.get(rule)
            row += [said.value, str(said.stop).lower()] if said else [None, None]
        rows.append(row)
    return csv_text(rows)
