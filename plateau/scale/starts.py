"""Tasks that bring no worker, for example because of a wrong path or an unreachable Redis.

Without this module, a task that fails at once would be submitted again after every snapshot.
"""

import math
from collections.abc import Iterable
from typing import Final

from plateau.scale.tasks import Snapshot

_FIRST_WAIT_S: Final = 30.0
_LONGEST_WAIT_S: Final = 900.0


class Starts:
    """Which tasks have brought a worker, and how long to wait after those that have not."""

    def __init__(self) -> None:
        self._there: set[str] = set()  # tasks at the last snapshot
        self._heard: set[str] = set()  # those of them whose worker has sent a heartbeat
        self._dismissed: set[str] = set()  # those of them that were cancelled or asked to leave
        self._submitted = 0  # tasks since the last snapshot
        self._failures = 0  # in a row
        self._until_s = -math.inf

    def note(self, snapshot: Snapshot) -> None:
        """Record the workers that have started, and the tasks that ended without one."""
        there = {task.id for task in snapshot.tasks}
        if any(
            task not in self._heard and not one.trouble for task, one in snapshot.workers.items()
        ):
            self._failures = 0
        self._heard |= snapshot.workers.keys()
        gone_unheard = self._there - there - self._heard - self._dismissed
        if gone_unheard or len(there - self._there) < self._submitted:
            self.note_failure(snapshot.now_s)
        self._there, self._submitted = there, 0
        self._heard &= there
        self._dismissed &= there

    def note_failure(self, now_s: float) -> None:
        """Wait before the next submission, longer after each failure in a row."""
        self._until_s = now_s + min(_FIRST_WAIT_S * 2**self._failures, _LONGEST_WAIT_S)
        self._failures += 1

    def note_submitted(self, count: int) -> None:
        """Expect this many new tasks at the next snapshot."""
        self._submitted += count

    def dismiss(self, tasks: Iterable[str]) -> None:
        """Expect these tasks to end."""
        self._dismissed.update(tasks)

    def held_s(self, now_s: float) -> float:
        """How long to submit nothing."""
        return max(0.0, self._until_s - now_s)
