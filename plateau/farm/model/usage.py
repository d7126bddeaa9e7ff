"""The sums of machine time over jobs."""

from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Grouping = Literal["job", "batch", "owner", "week"]

ROW: Final[dict[str, Any]] = {
    "key": "exposures",
    "name": "",
    "jobs": 12,
    "machine_s": 124.8,
    "wasted_s": 0.6,
    "core_hours": 0.277333333,
    "saved_core_hours": 1.2,
}


class UsageRow(BaseModel):
    """What some jobs have cost."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"examples": [ROW]})

    key: str = Field(
        description="id of the job or of the owner's API key, name of the batch, or ISO week of "
        'the submission (UTC); "" for jobs of no batch, or made without a key, and for the total'
    )
    name: str = Field(description='of the job or of the API key; "" otherwise')
    jobs: int = 0
    machine_s: float = Field(0.0, description="seconds that render children spent")
    wasted_s: float = Field(
        0.0, description="of those, on tries of which another was committed first"
    )
    core_hours: float = Field(0.0, description="that time times the threads of each render child")
    saved_core_hours: float = Field(
        0.0,
        description="what the stops saved below the caps, estimated for each job at its mean rate",
    )

    def add(self, other: "UsageRow") -> None:
        """Add what other jobs have cost."""
        self.jobs += other.jobs
        self.machine_s = round(self.machine_s + other.machine_s, 3)
        self.wasted_s = round(self.wasted_s + other.wasted_s, 3)
        self.core_hours = round(self.core_hours + other.core_hours, 9)
        self.saved_core_hours = round(self.saved_core_hours + other.saved_core_hours, 9)
