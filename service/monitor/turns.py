"""Which of its jobs a monitor looks at next."""

from collections import deque
from collections.abc import Callable, Collection, Iterator
from typing import Final

from plateau.farm.process.backoff import Backoff

#: A monitor looks at its jobs at least this often, also where nobody hints at one.
IDLE_S: Final = 1.0
#: Where a round over all jobs takes long, rounds take this share of the monitor's time,
ROUNDS_SHARE: Final = 0.1
#: as long as the pause between two rounds is not longer than this.
LONGEST_IDLE_S: Final = 5.0
#: A monitor looks at jobs without a hint for this long; then it asks for new hints.
ROUND_S: Final = 0.1
#: The first and the longest wait where something is away.
RETRY_S: Final = (0.5, 10.0)


class Turns:
    """The turns of a monitor's jobs.

    Jobs with a hint come first. All others have their turn in rounds, since hints may be lost. A
    round that takes long, as it does where a thousand jobs wait, is interrupted by new hints and
    continued after them. The next round is put off, so that a monitor whose jobs all wait has
    little to do. A job that lacks something is left alone for a while.

    Parameters
    ----------
    clock
        Seconds that never go back.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._fresh: deque[str] = deque()  # just taken; perhaps no hint comes
        self._round: deque[str] = deque()  # jobs still to be looked at in this round
        self._round_due = float("-inf")  # when the next one begins
        self._round_s = 0.0  # spent in this one
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
        """Take note that the job lacks nothing."""
        self._put_off.pop(job_id, None)

    def next_jobs(self, owned: Collection[str], hinted: Collection[str]) -> Iterator[str]:
        """The jobs that have their turn now, one after the other.

        Parameters
        ----------
        owned
            The monitor's jobs, in the order in which it took them; it may give up some meanwhile.
        hinted
            Jobs of which something was heard.
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
        """Those of these jobs that had no hint, until this time."""
        while waiting and self._clock() < until:
            job_id = waiting.popleft()
            if job_id in owned and job_id not in hinted and self._is_due(job_id):
                yield job_id

    def _is_due(self, job_id: str) -> bool:
        return self._clock() >= self._put_off.get(job_id, (float("-inf"), None))[0]
