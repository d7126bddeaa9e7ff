"""Which jobs a monitor takes, and the order in which it looks at them."""

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence, Sized
from typing import Final

from plateau.farm.process.waits import Backoff

#: The usual pause between two rounds over all jobs.
IDLE_S: Final = 1.0
#: The share of the monitor's time for long rounds, which lengthen the pause,
ROUNDS_SHARE: Final = 0.1
#: and the longest pause.
LONGEST_IDLE_S: Final = 5.0
#: How long a monitor looks at jobs without a hint before it looks for new hints.
ROUND_S: Final = 0.1
#: The first and the longest wait while something is away.
RETRY_S: Final = (0.5, 10.0)
#: How long a free job beyond a monitor's share is left to the other monitors.
LEFT_S: Final = 1.0


class Share:
    """A monitor's share of the jobs: as many as every other living monitor has.

    A free job beyond it is left to the others for a moment, and then taken: they may be busy.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._left: dict[str, float] = {}  # since when, by job

    def jobs_to_take(
        self, free: Sequence[str], owned: Sized, *, jobs: int, monitors: int
    ) -> Iterator[str]:
        """Yield those of the free jobs to take; `owned` grows meanwhile.

        `jobs` and `monitors` are all jobs that need a monitor, and all living monitors.
        """
        share, now = math.ceil(jobs / max(1, monitors)), self._clock()
        self._left = {job_id: self._left.get(job_id, now) for job_id in free}
        for job_id in free:
            if len(owned) < share or now >= self._left[job_id] + LEFT_S:
                yield job_id


class Turns:
    """The turns of a monitor's jobs.

    Jobs with a hint come first. All others have their turn in rounds, because hints may be lost.
    New hints interrupt a long round, which then continues. After a long round the pause is longer,
    so that a monitor with a thousand waiting jobs has little to do. A job that lacks something is
    left alone for a while. `clock` is monotonic, in seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._fresh: deque[str] = deque()  # just taken, perhaps without a hint
        self._round: deque[str] = deque()  # jobs that remain in this round
        self._round_due = float("-inf")  # when the next round begins
        self._round_s = 0.0  # spent in this round
        self._put_off: dict[str, tuple[float, Backoff]] = {}  # until when, by job

    @property
    def wait_s(self) -> float:
        """How long the monitor may wait for a hint."""
        return 0.0 if self._fresh or self._round else IDLE_S

    def add(self, job_id: str) -> None:
        """Give a turn to a job that the monitor has just taken."""
        self._fresh.append(job_id)

    def put_off(self, job_id: str) -> None:
        """Leave a job alone for a while, longer each time."""
        _, backoff = self._put_off.get(job_id, (0.0, Backoff(*RETRY_S)))
        self._put_off[job_id] = self._clock() + backoff.delay_s(), backoff

    def note_success(self, job_id: str) -> None:
        """End the waits of a job that lacks nothing any more."""
        self._put_off.pop(job_id, None)

    def next_jobs(self, owned: Collection[str], hinted: Collection[str]) -> Iterator[str]:
        """Yield the jobs whose turn it is.

        `owned` are the monitor's jobs, oldest first; it may give up some meanwhile.
        """
        for job_id in [one for one in owned if one in hinted]:
            if self._is_due(job_id):
                yield job_id
        until = self._clock() + ROUND_S
        yield from self._some(self._fresh, owned, hinted, until)
        started = self._clock()
        if not self._round and started >= self._round_due:
            self._round, self._round_s = deque(owned), 0.0
        if not self._round:
            return
        yield from self._some(self._round, owned, hinted, until)
        ended = self._clock()
        self._round_s += ended - started
        if not self._round:
            pause_s = max(IDLE_S, self._round_s / ROUNDS_SHARE)
            self._round_due = ended + min(pause_s, LONGEST_IDLE_S)

    def _some(
        self, waiting: deque[str], owned: Collection[str], hinted: Collection[str], until: float
    ) -> Iterator[str]:
        """Yield the waiting jobs without a hint, until this time."""
        while waiting and self._clock() < until:
            job_id = waiting.popleft()
            if job_id in owned and job_id not in hinted and self._is_due(job_id):
                yield job_id

    def _is_due(self, job_id: str) -> bool:
        return self._clock() >= self._put_off.get(job_id, (float("-inf"), None))[0]
