"""Tasks that come to nothing: a wrong path, a Redis that no machine there reaches, a broken disk.

Without this, one that ends at once would be submitted again at every look, for ever.
"""

import math
from collections.abc import Iterable
from typing import Final

from plateau.scale.tasks import Look

_FIRST_WAIT_S: Final = 30.0
_LONGEST_WAIT_S: Final = 900.0


class Starts:
    """Which tasks have brought a worker, and how long to wait since others have not."""

    def __init__(self) -> None:
        self._there: set[str] = set()  # at the last look
        self._heard: set[str] = set()  # of those, by a worker's heartbeat
        self._dismissed: set[str] = set()  # and those that we have sent away
        self._submitted = 0  # since the last look
        self._failures = 0  # in a row
        self._until_s = -math.inf

    def note(self, look: Look) -> None:
        """Take note of who has come, and of who has gone without ever having been heard."""
        there = {task.id for task in look.tasks}
        if any(task not in self._heard and not one.trouble for task, one in look.workers.items()):
            self._failures = 0
        self._heard |= look.workers.keys()
        gone_unheard = self._there - there - self._heard - self._dismissed
        if gone_unheard or len(there - self._there) < self._submitted:
            self.note_failure(look.now_s)
        self._there, self._submitted = there, 0
        self._heard &= there
        self._dismissed &= there

    def note_failure(self, now_s: float) -> None:
        """Wait with the next ones, longer each time in a row."""
        self._until_s = now_s + min(_FIRST_WAIT_S * 2**self._failures, _LONGEST_WAIT_S)
        self._failures += 1

    def note_submitted(self, count: int) -> None:
        """Expect so many tasks at the next look."""
        self._submitted += count

    def dismiss(self, tasks: Iterable[str]) -> None:
        """Expect these to go."""
        self._dismissed.update(tasks)

    def held_s(self, now_s: float) -> float:
        """For how long nothing is to be submitted."""
        return max(0.0, self._until_s - now_s)
