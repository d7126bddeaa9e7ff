"""Predicts when the current slice ends, for a worker that is to stop."""

import time
from typing import Final

#: A slice that is this late, compared with the one before, is not waited for.
_LATE_S: Final = 1.0


class Pace:
    """Compares the current slice with the one before; may be called from any thread."""

    def __init__(self) -> None:
        self._took: tuple[str, float] | None = None  # the last slice's job and its seconds
        self._ends_at: float | None = None

    def began(self, job_id: str) -> None:
        """Note that a slice of the job begins."""
        known = self._took is not None and self._took[0] == job_id
        self._ends_at = time.monotonic() + self._took[1] if known and self._took else None

    def took(self, job_id: str, seconds: float) -> None:
        """Note how long it took."""
        self._took = (job_id, seconds)

    def ends_within(self, seconds: float) -> bool:
        """Return whether the current slice is expected to end within so many seconds."""
        ends_at = self._ends_at
        return ends_at is not None and -_LATE_S < ends_at - time.monotonic() < seconds
