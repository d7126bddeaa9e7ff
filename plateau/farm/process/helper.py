"""A process for work that would hold up its parent: it answers one question after the other.

`HelperProcess` is the parent's side, `serve` the child's. Parts go between them, each after its
length.
"""

import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Final

from plateau.farm.process.lifecycle import die_with_parent, plain_environment

#: Seconds for which a process waits for the next question: it has loaded by then what it needs.
_KEPT_S: Final = 30.0
#: Below its parent, as a worker's renderer is.
_NICENESS: Final = 10
_LENGTH: Final = struct.Struct("<Q")


class NoAnswer(Exception):
    """The process did not answer; it may if it is asked again."""


class HelperProcess:
    """Asks a program one question at a time, in a process that is kept for the next one.

    Ask from one thread only: the process ends with that thread.

    Parameters
    ----------
    module
        The program's name: it calls `serve`.
    kept_s
        For how many seconds the process waits for the next question.
    """

    def __init__(self, module: str, kept_s: float = _KEPT_S) -> None:
        self._module = module
        self._kept_s = kept_s
        self._lock = threading.Lock()  # around what follows
        self._process: _Process | None = None
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
            The process failed, took longer than `limit_s`, or was closed. What `write` raises ends
            the process, too.
        """
        process = self._begin()
        try:
            answer = process.ask(write, limit_s)
        except BaseException:
            self._rest(is_kept=False)
            raise
        self._rest(is_kept=True)
        return answer

    def _begin(self) -> "_Process":
        with self._lock:
            if self._is_closed:
                raise NoAnswer("the monitor stops")
            self._ends_idle.cancel()
            if self._process is not None and not self._process.is_alive:
                self._end()
            self._process = self._process or _Process(self._module)
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


class _Process:
    """A process that answers."""

    def __init__(self, module: str) -> None:
        self._words = tempfile.TemporaryFile()  # noqa: SIM115  (what it says; closed by `end`)
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._words,
            env=plain_environment(),
            preexec_fn=die_with_parent(signal.SIGKILL),
            start_new_session=True,
        )

    @property
    def is_alive(self) -> bool:
        return self._process.poll() is None

    def kill(self) -> None:
        self._process.kill()

    def end(self) -> None:
        """End it, and close what it has."""
        self._words.close()
        with suppress(BrokenPipeError), self._process:
            self._process.kill()

    def ask(self, write: Callable[[IO[bytes]], object], limit_s: float) -> bytes:
        """Return the answer, or raise `NoAnswer`; then the process is of no use any more."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        is_late = threading.Event()

        def end() -> None:
            is_late.set()
            self._process.kill()

        deadline = threading.Timer(limit_s, end)
        deadline.start()
        try:
            with suppress(BrokenPipeError):  # its end says why
                write(stdin)
                stdin.flush()
            return read_part(stdout)
        except EOFError:
            if is_late.is_set():
                raise NoAnswer(f"it took more than {limit_s:.0f} s") from None
            status = self._process.wait()
            self._words.seek(0)
            said = self._words.read().decode(errors="replace").strip().rpartition("\n")[2]
            raise NoAnswer(said or f"its process ended with status {status}") from None
        finally:
            deadline.cancel()


def serve(answer: Callable[[IO[bytes]], bytes | memoryview]) -> None:
    """Answer questions on the standard input, which `answer` reads, each whole.

    An exception ends the process; the parent has its last line.
    """
    os.nice(_NICENESS)
    with open(0, "rb") as questions, open(1, "wb") as answers:
        while questions.peek(1):
            write_part(answers, answer(questions))
            answers.flush()


def write_part(stream: IO[bytes], content: bytes | memoryview) -> None:
    """Write a part; the stream may hold it back until it is flushed."""
    stream.write(_LENGTH.pack(len(content)))
    stream.write(content)


def read_part(stream: IO[bytes]) -> bytes:
    """Return the next part; raises EOFError where the stream ends before its end."""
    head = stream.read(_LENGTH.size)
    if len(head) == _LENGTH.size:
        (length,) = _LENGTH.unpack(head)
        content = stream.read(length)
        if len(content) == length:
            return content
    raise EOFError("the stream has ended")
