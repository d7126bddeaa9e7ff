"""A terminal of its own for a `plateau` command: what a person would see on the screen."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable

import pyte


class Terminal:
    """A command under way in a real pseudo-terminal, and the screen that it draws.

    Parameters
    ----------
    arguments
        The command line after ``plateau``.
    columns, rows
        The terminal's size.
    stdout
        Where standard output goes, where that is not the terminal.
    """

    def __init__(
        self,
        *arguments: str,
        columns: int = 100,
        rows: int = 30,
        stdout: int | None = None,
        **environment: str,
    ) -> None:
        self.written = b""  #: all that it has sent to the terminal
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self.screen)
        self._ours, theirs = pty.openpty()
        self.resize(columns, rows)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "plateau", *arguments],
            stdin=theirs,
            stdout=theirs if stdout is None else stdout,
            stderr=theirs,
            env={
                "PATH": os.environ["PATH"],
                "LANG": "C.UTF-8",
                "TERM": "xterm-256color",
                **environment,
            },
            start_new_session=True,
        )
        os.close(theirs)

    def resize(self, columns: int, rows: int) -> None:
        """Give it another size, as a person does who drags its corner."""
        fcntl.ioctl(self._ours, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self.screen.resize(rows, columns)

    def lines(self) -> list[str]:
        """The lines of the screen, without spaces at their ends."""
        return [line.rstrip() for line in self.screen.display]

    def until(self, seen: Callable[[list[str]], object], seconds: float = 60) -> list[str]:
        """The screen once it shows what is looked for."""
        deadline = time.monotonic() + seconds
        while not seen(self.lines()):
            assert time.monotonic() < deadline, "\n".join(["not seen in:", *self.lines()])
            self._read(0.1)
        return self.lines()

    def exit_code(self, seconds: float = 60) -> int:
        """Its exit code, once it has ended and all that it wrote was read."""
        deadline = time.monotonic() + seconds
        while self.process.poll() is None:
            assert time.monotonic() < deadline, "\n".join(["it did not end:", *self.lines()])
            self._read(0.1)
        while self._read(0.1):
            pass
        return self.process.returncode

    def close(self) -> None:
        """End it, by force where it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._ours)

    def _read(self, seconds: float) -> bool:
        """Take up what it writes within the time; whether there was something."""
        if not select.select([self._ours], [], [], seconds)[0]:
            return False
        try:
            read = os.read(self._ours, 65_536)
        except OSError:  # nobody has the other end any more
            return False
        self.written += read
        self._stream.feed(read)
        return bool(read)
