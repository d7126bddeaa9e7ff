"""Tables as CSV, such as a curve: the same from the API and from `plateau judge`."""

import csv
import io
from collections.abc import Iterable
from itertools import chain
from typing import Final

from plateau.farm.model.job import CurvePoint

#: With what a spreadsheet's formulas begin.
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
#: The columns of a curve that are numbers.
FIGURES: Final = tuple(
    name for name in CurvePoint.model_fields if name not in {"rules", "non_finite_pixels", "at"}
)


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """The rows as CSV; text that a spreadsheet takes for a formula begins with an apostrophe."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows(map(_without_formula, row) for row in rows)
    return text.getvalue()


def _without_formula(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


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
