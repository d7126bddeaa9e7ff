"""Standard input, output and error of a command, whatever it was started with.

One that is closed is as if it were /dev/null. What the terminal cannot show is replaced. Python
itself works in UTF-8, also where the locale does not: names of files and what scenes say depend on
it. What standard error does not take is lost; what standard output does not take is an error.
"""

import codecs
import io
import locale
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from plateau.errors import ExitCode

_OUTPUT: Final = "standard output"


@contextmanager
def standard_streams() -> Iterator[None]:
    """Mend the streams of the process, for as long as a command runs."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free
    _work_in_utf_8()
    sys.stdin = sys.stdin or open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout, sys.stderr = _stream(1, sys.stdout), _stream(2, sys.stderr)
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except OSError as error:
        if error.filename != _OUTPUT:
            raise
        if not isinstance(error, BrokenPipeError):
            print(f"plateau: {_OUTPUT}: {error.strerror}", file=sys.stderr)
        raise SystemExit(ExitCode.FAILED) from None


def _work_in_utf_8() -> None:
    """Start this process again, in Python's UTF-8 mode, unless it works in UTF-8."""
    names = (locale.getpreferredencoding(False), sys.getfilesystemencoding())
    if all(codecs.lookup(name).name == "utf-8" for name in names):
        if sys.flags.utf8_mode:
            os.environ.pop("PYTHONIOENCODING", None)  # the terminal's, and no log file's
        return
    shown = getattr(sys.stdout or sys.stderr, "encoding", "ascii")
    os.environ.update(PYTHONUTF8="1", PYTHONIOENCODING=f"{shown}:replace")
    os.execv(sys.executable, [sys.executable, "-X", "utf8", *sys.orig_argv[1:]])


def _stream(number: int, python_s: Any) -> io.TextIOWrapper:
    raw = _Raw(number, "wb", closefd=False)
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=getattr(python_s, "encoding", "utf-8"),
        errors="replace",
        line_buffering=number == 2 or raw.isatty(),
    )


class _Raw(io.FileIO):
    """A stream that fails once at most."""

    failed = False

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if not self.failed and self.fileno() == 1:
                self.failed = True
                error.filename = _OUTPUT
                raise
            return len(data)
