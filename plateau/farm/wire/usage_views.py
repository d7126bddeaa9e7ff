"""What jobs have cost in sum, as JSON and CSV."""

import csv
import io
from datetime import datetime
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.usage import ROW, Grouping, UsageRow

#: With what a spreadsheet's formulas begin.
_FORMULA: Final = ("=", "+", "-", "@", "\t")


class Usage(BaseModel):
    """What the stored jobs have cost in sum."""

    model_config = ConfigDict(
        extra="ignore",
        json_schema_extra={
            "examples": [
                {
                    "by": "batch",
                    "since": "2026-11-01T00:00:00Z",
                    "until": "2026-12-01T00:00:00Z",
                    "rows": [ROW],
                    "left_out": 0,
                    "total": {**ROW, "key": ""},
                }
            ]
        },
    )

    by: Grouping
    since: datetime | None = Field(description="jobs submitted from then on")
    until: datetime | None = Field(description="and before then")
    rows: list[UsageRow] = Field(description="by core hours, most first; weeks by time")
    left_out: int = Field(description="rows beyond `limit`, those of the fewest core hours")
    total: UsageRow = Field(description="of all rows, those left out too")


def usage_csv(usage: Usage) -> str:
    """The rows as CSV.

    A name that a spreadsheet would take for a formula begins with an apostrophe.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(UsageRow.model_fields)
    for row in usage.rows:
        writer.writerow(map(_as_text, row.model_dump().values()))
    return text.getvalue()


def _as_text(value: object) -> object:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value
