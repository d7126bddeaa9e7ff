"""The order to stop, which also ends a wait on sockets."""

import math
import os
import select
import threading
import weakref
from typing import Protocol


class Readable(Protocol):
    """A socket, or a `Stop`."""

    def fileno(self) -> int:
        """The file descriptor to poll."""


class Stop(threading.Event):
    """An event that is set once, and from then on is readable for `select.poll`."""

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
        """The file descriptor to poll."""
        return self._readable


def await_any(*readable: Readable, timeout_s: float | None = None) -> None:
    """Wait until one of them is readable, or for `timeout_s`."""
    poll = select.poll()
    for one in readable:
        poll.register(one, select.POLLIN)
    poll.poll(None if timeout_s is None else math.ceil(max(0.0, timeout_s) * 1000))
