"""Tells a render child that is stuck from one that is slow.

A scene may take as long as it takes. A child that owes an answer works for it, and so uses
processor time, however slow its scene or its machine is. One that uses none at all was stopped, is
in a deadlock, or waits for a disk. A child that works and gets nowhere is known by its own pace.
"""

import time
from typing import Final

import psutil

#: A child that used no processor time for so long is stuck. A busy machine gives it some.
STILL_S: Final = 60.0
#: Its worker says so after this time.
_TOLD_S: Final = 15.0

#: A part of a pass that takes so many times as long as any before it will not end.
_OFF_PACE: Final = 20.0
#: Nor is a part late before this time: machines are busy, and disks.
_LEAST_S: Final = 120.0


class ChildWatch:
    """Watches one render child while it owes an answer.

    On a GPU a child may wait for a kernel without using the processor, so there only a stopped
    process counts as still. `trouble` may be read from any thread.
    """

    def __init__(self, pid: int, *, on_gpu: bool) -> None:
        self._process = psutil.Process(pid)
        self._on_gpu = on_gpu
        self._used_s = -1.0  # processor time, of all threads
        self._still_since: float | None = None  # while it owes an answer
        self._longest_s = 0.0  # of the parts of its scene's passes
        self._most_samples = 0  # of the passes that it has ended

    @property
    def trouble(self) -> str | None:
        """What to say of a child that has been still for a while."""
        since = self._still_since
        if since is None or time.monotonic() < since + _TOLD_S:
            return None
        return f"its render child uses no processor time; it is ended after {STILL_S:g} s"

    def asked(self) -> None:
        """Begin to watch: the child owes an answer from now on."""
        self._still_since = time.monotonic()

    def answered(self) -> None:
        """End the watch."""
        self._still_since = None

    def stuck(self) -> str | None:
        """Look at the child; return what is wrong if it has been still for too long."""
        if self._has_worked() or self._still_since is None:
            self._still_since = time.monotonic()
        if time.monotonic() < self._still_since + STILL_S:
            return None
        return f"used no processor time for {STILL_S:g} s"

    def _has_worked(self) -> bool:
        try:
            with self._process.oneshot():
                times, status = self._process.cpu_times(), self._process.status()
        except psutil.Error:
            return True  # it has ended, which its socket tells
        before, self._used_s = self._used_s, times.user + times.system
        return self._used_s != before or (self._on_gpu and status != psutil.STATUS_STOPPED)

    def new_scene(self) -> None:
        """Forget the pace of the scene before."""
        self._longest_s, self._most_samples = 0.0, 0

    def took(self, part_s: float) -> None:
        """Note the time of a part of a pass."""
        self._longest_s = max(self._longest_s, part_s)

    def ended(self, samples: int) -> None:
        """Note that a pass of so many samples has ended: no part was left out of the pace."""
        self._most_samples = max(self._most_samples, samples)

    def limit_s(self, most_s: float, samples: int) -> float:
        """Return how long a part of a pass of so many samples may take.

        Parameters
        ----------
        most_s : float
            The limit, in seconds, while the scene's pace is not known for such a pass.
        """
        if samples > self._most_samples:
            return max(most_s, _OFF_PACE * self._longest_s)
        return max(min(most_s, _LEAST_S), _OFF_PACE * self._longest_s)
