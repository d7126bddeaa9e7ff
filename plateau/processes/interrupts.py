"""Counts signals: the first one asks to stop, the second one insists."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

from plateau.farm.process.waits import Stop

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupts:
    """While the context lasts, these signals (or all three) are counted and do not end the process.

    A signal that was ignored (by ``nohup``, or in the background of a shell) stays ignored. In
    another thread than the main one nothing is counted.
    """

    def __init__(self, *signals: signal.Signals) -> None:
        self._signals = signals or _SIGNALS
        self.asked = Stop()  #: set by the first signal
        self.insisted = Stop()  #: set by the second signal
        self._first: int = signal.SIGINT
        self._before: dict[int, Any] = {}
        self._ends_by: Stop | None = None

    @property
    def exit_code(self) -> int:
        """128 + the first signal, the exit code of a process that it ended."""
        return 128 + self._first

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is not threading.main_thread():
            return self
        for number in self._signals:
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._count)
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def ended_by(self, order: Stop) -> Iterator[None]:
        """Raise `KeyboardInterrupt` at once, at `asked` or at `insisted`, while this lasts.

        Also if it was set before.
        """
        self._ends_by = order
        try:
            if order.is_set():
                raise KeyboardInterrupt
            yield
        finally:
            self._ends_by = None

    def _count(self, number: int, _: FrameType | None) -> None:
        if self.asked.is_set():
            self.insisted.set()
        else:
            self._first = number
            self.asked.set()
        if self._ends_by is not None and self._ends_by.is_set():
            raise KeyboardInterrupt
