"""A process of the monitor's for work that would hold up its jobs: it answers one question."""

import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import IO

from plateau.farm.process.lifecycle import die_with_parent, plain_environment


class NoAnswer(Exception):
    """The process did not answer; it may if it is asked again."""


class HelperProcess:
    """Asks a program one question at a time, each in a process of its own.

    Parameters
    ----------
    module
        The program's name: it reads a question from its standard input, and writes an answer.
    """

    def __init__(self, module: str) -> None:
        self._module = module
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._is_closed = False

    def close(self) -> None:
        """End the process, if one runs, and start no other."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()

    def ask(self, write: Callable[[IO[bytes]], object], limit_s: float) -> bytes:
        """Return the answer to the question that `write` writes.

        Raises
        ------
        NoAnswer
            The process failed, took longer than `limit_s`, or was closed. What `write` raises ends
            the process, too.
        """
        with self._lock:
            if self._is_closed:
                raise NoAnswer("the monitor stops")
            process = self._process = subprocess.Popen(
                [sys.executable, "-m", self._module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=plain_environment(),
                preexec_fn=die_with_parent(signal.SIGKILL),
                start_new_session=True,
            )
        is_late = threading.Event()

        def end() -> None:
            is_late.set()
            process.kill()

        deadline = threading.Timer(limit_s, end)
        deadline.start()
        try:
            assert process.stdin is not None
            with suppress(BrokenPipeError):  # its end says why
                write(process.stdin)
                process.stdin.flush()
            answer, words = process.communicate()
        except BaseException:
            process.kill()
            process.communicate()
            raise
        finally:
            deadline.cancel()
            self._process = None
        if is_late.is_set():
            raise NoAnswer(f"it took more than {limit_s:.0f} s")
        if process.returncode:
            said = words.decode(errors="replace").strip().rpartition("\n")[2]
            raise NoAnswer(said or f"its process ended with status {process.returncode}")
        return answer
