"""How long the slices of a job take here: so a worker that stops knows whether one ends soon."""

import time
from typing import Final

#: A slice that takes so much longer than the one before is not waited for any more.
_LATE_S: Final = 1.0


class Pace:
    """The slice in hand, against the one before it; may be asked from any thread."""

    def __init__(self) -> None:
        self._took: tuple[str, float] | None = None  # the job of the last slice, and its seconds
        self._ends_at: float | None = None

    def began(self, job_id: str) -> None:
        """A slice of the job begins."""
        known = self._took is not None and self._took[0] == job_id
        self._ends_at = time.monotonic() + self._took[1] if known and self._took else None

    def took(self, job_id: str, seconds: float) -> None:
        """It took so long."""
        self._took = (job_id, seconds)

    def ends_within(self, seconds: float) -> bool:
        """Whether the slice in hand is expected to end in so many seconds, at most."""
        ends_at = self._ends_at
        return ends_at is not None and -_LATE_S < ends_at - time.monotonic() < seconds
