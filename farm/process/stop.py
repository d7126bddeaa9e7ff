"""The order to stop, of which a wait on sockets hears too."""

import math
import os
import select
import threading
import weakref
from typing import Protocol


class Readable(Protocol):
    """What can be polled: a socket, or a `Stop`."""

    def fileno(self) -> int:
        """Its file descriptor."""


class Stop(threading.Event):
    """An event that is set once, and is readable from then on for `select.poll` and its kin."""

    def __init__(self) -> None:
        super().__init__()
        self._readable, self._writable = os.pipe()
        for descriptor in (self._readable, self._writable):
            weakref.finalize(self, os.close, descriptor)

    def set(self) -> None:
        """Give the order."""
        if not self.is_set():
            os.write(self._writable, b"\0")
        super().set()

    def fileno(self) -> int:
        """What to poll."""
        return self._readable


def await_any(*readable: Readable, timeout_s: float | None = None) -> None:
    """Wait until one of them is readable, for so long at most."""
    poll = select.poll()
    for one in readable:
        poll.register(one, select.POLLIN)
    poll.poll(None if timeout_s is None else math.ceil(max(0.0, timeout_s) * 1000))
