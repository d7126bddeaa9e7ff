"""Waits: until the order to stop, which also ends one on sockets, and between two tries."""

import math
import os
import random
import select
import threading
import weakref
from typing import Protocol


class Readable(Protocol):
    """A socket, or a `Stop`."""

    def fileno(self) -> int:
        """The file descriptor to poll."""


class Stop(threading.Event):
    """An event that is set once, and from then on is readable for `select.poll`.

    It has no lock, so a signal handler may set it while its own thread waits for it.
    """

    def __init__(self) -> None:
        super().__init__()
        self._is_given = False
        self._readable, self._writable = os.pipe()
        for descriptor in (self._readable, self._writable):
            weakref.finalize(self, os.close, descriptor)

    def is_set(self) -> bool:
        """Whether the order was given."""
        return self._is_given

    def set(self) -> None:
        """Give the order."""
        if not self._is_given:
            self._is_given = True
            os.write(self._writable, b"\0")

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for the order, or for so many seconds; return whether it was given."""
        await_any(self, timeout_s=timeout)
        return self._is_given

    def fileno(self) -> int:
        """The file descriptor to poll."""
        return self._readable


def await_any(*readable: Readable, timeout_s: float | None = None) -> None:
    """Wait until one of them is readable, or for `timeout_s`, but no longer than 23 days."""
    poll = select.poll()
    for one in readable:
        poll.register(one, select.POLLIN)
    poll.poll(None if timeout_s is None else math.ceil(1000 * min(max(0.0, timeout_s), 2e6)))


class Backoff:
    """Delays between tries while a service is away, that double from `first_s` up to `longest_s`.

    A jitter of half spreads each delay, so that a farm's processes do not retry at once.
    """

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def delay_s(self) -> float:
        """The next delay in seconds; the one after it is twice as long."""
        delay_s = self._next_s * random.uniform(0.5, 1.5)
        self._next_s = min(2 * self._next_s, self._longest_s)
        return delay_s

    def reset(self) -> None:
        """Begin again with the first delay, after a success."""
        self._next_s = self._first_s
