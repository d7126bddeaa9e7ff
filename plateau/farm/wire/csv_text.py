"""Tables as CSV."""

import csv
import io
from collections.abc import Iterable
from typing import Final

#: With what a spreadsheet's formulas begin.
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """The rows as CSV; text that a spreadsheet takes for a formula begins with an apostrophe."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows(map(_without_formula, row) for row in rows)
    return text.getvalue()


def _without_formula(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
