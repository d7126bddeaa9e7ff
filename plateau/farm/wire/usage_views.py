"""What jobs have cost in sum, as JSON and CSV."""

import csv
import io
from datetime import datetime
from typing import Any, Final

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.usage import Grouping, Spent

#: With what a spreadsheet's formulas begin.
_FORMULA: Final = ("=", "+", "-", "@", "\t")
_ROW: Final[dict[str, Any]] = {
    "key": "exposures",
    "name": "",
    "jobs": 12,
    "machine_s": 124.8,
    "wasted_s": 0.6,
    "core_hours": 0.277333,
    "saved_core_hours": 1.2,
}


class UsageRow(BaseModel):
    """What some jobs have cost."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [_ROW]})

    key: str = Field(
        description="id of the job or of the owner's API key, name of the batch, or ISO week of "
        'the submission (UTC); "" for jobs of no batch, or made without a key, and for the total'
    )
    name: str = Field(description='of the job or of the API key; "" otherwise')
    jobs: int
    machine_s: float = Field(description="seconds that render children spent")
    wasted_s: float = Field(description="of those, on tries of which another was committed first")
    core_hours: float = Field(description="that time times the threads of each render child")
    saved_core_hours: float = Field(
        description="what the stops saved below the caps, estimated for each job at its mean rate"
    )


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
                    "rows": [_ROW],
                    "left_out": 0,
                    "total": {**_ROW, "key": ""},
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


def row_view(spent: Spent) -> UsageRow:
    """The sums as the API shows them."""
    return UsageRow(
        key=spent.key,
        name=spent.name,
        jobs=spent.jobs,
        machine_s=spent.machine_ms / 1000,
        wasted_s=spent.wasted_ms / 1000,
        core_hours=round(spent.core_hours, 6),
        saved_core_hours=round(spent.saved_core_hours, 6),
    )


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
