"""The sums of machine time over jobs."""

from dataclasses import dataclass
from typing import Literal

Grouping = Literal["job", "batch", "owner", "week"]


@dataclass
class Spent:
    """What some jobs have spent."""

    key: str  #: id of the job or of the owner's API key, name of the batch, week; "" for none
    name: str  #: of the job or of the API key
    jobs: int = 0
    machine_ms: int = 0
    wasted_ms: int = 0
    core_hours: float = 0.0
    saved_core_hours: float = 0.0

    def add(self, other: "Spent") -> None:
        """Add what other jobs have spent."""
        self.jobs += other.jobs
        self.machine_ms += other.machine_ms
        self.wasted_ms += other.wasted_ms
        self.core_hours += other.core_hours
        self.saved_core_hours += other.saved_core_hours
