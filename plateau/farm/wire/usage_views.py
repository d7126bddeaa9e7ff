"""What jobs have cost in sum, as JSON and CSV."""

from datetime import datetime

from pydantic import BaseModel, ConfigDict, Field

from plateau.farm.model.usage import ROW, Grouping, UsageRow
from plateau.farm.wire.csv_text import csv_text


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
    """The rows as CSV."""
    return csv_text([UsageRow.model_fields, *(row.model_dump().values() for row in usage.rows)])
