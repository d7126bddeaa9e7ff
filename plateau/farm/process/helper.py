"""A child for work that would hold up its parent, kept for the next question."""

import threading
from collections.abc import Callable
from typing import IO, Final

from plateau.farm.process.child import Child, NoAnswer

#: Seconds for which a process waits for the next question: it has loaded by then what it needs.
_KEPT_S: Final = 30.0


class HelperProcess:
    """Asks a program one question at a time, in a process that is kept for the next one.

    Ask from one thread only: the process ends with that thread.

    Parameters
    ----------
    module
        The program's name: it calls `plateau.farm.process.child.serve`.
    kept_s
        For how many seconds the process waits for the next question.
    """

    def __init__(self, module: str, kept_s: float = _KEPT_S) -> None:
        self._module = module
        self._kept_s = kept_s
        self._lock = threading.Lock()  # around what follows
        self._process: Child | None = None
        self._is_asked = False
        self._ends_idle = threading.Timer(0, self._end_if_idle)
        self._is_closed = False

    def close(self) -> None:
        """End the process, if one runs, and start no other."""
        with self._lock:
            self._is_closed = True
            if self._process is not None and self._is_asked:
                self._process.kill()  # whoever asks does the rest
        self._end_if_idle()

    def ask(self, write: Callable[[IO[bytes]], object], limit_s: float) -> bytes:
        """Return the answer to the question that `write` writes.

        Raises
        ------
        NoAnswer
            The process failed, took longer than `limit_s`, or was closed, or `write` raised.
        """
        process = self._begin()
        try:
            answer = process.ask(write, limit_s)
        except BaseException:
            self._rest(is_kept=False)
            raise
        self._rest(is_kept=True)
        return answer

    def _begin(self) -> Child:
        with self._lock:
            if self._is_closed:
                raise NoAnswer("the monitor stops")
            self._ends_idle.cancel()
            if self._process is not None and not self._process.is_alive:
                self._end()
            self._process = self._process or Child(self._module)
            self._is_asked = True
            return self._process

    def _rest(self, *, is_kept: bool) -> None:
        with self._lock:
            self._is_asked = False
            if is_kept and not self._is_closed:
                self._ends_idle = threading.Timer(self._kept_s, self._end_if_idle)
                self._ends_idle.daemon = True
                self._ends_idle.start()
                return
        self._end_if_idle()

    def _end_if_idle(self) -> None:
        with self._lock:
            if not self._is_asked:
                self._ends_idle.cancel()
                self._end()

    def _end(self) -> None:
        if self._process is not None:
            self._process.end()
            self._process = None
