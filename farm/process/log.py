"""Structured logs: every line of a Plateau process says who wrote it and what it is about.

Modules log by `logging` as ever. Here, once for each process, every record (a library's too) is
given the process's own fields (``role``, ``worker`` or ``monitor``) and those of what the thread is
about at the time (``job``, ``slice``), and is written as a line for people or for programs.
"""

import copy
import json
import logging
import math
import os
import re
import shutil
import sys
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Final, TextIO

from plateau.farm.process.settings import LogFormat

#: The fields of this process: who it is does not depend on what any of its threads is about.
_PROCESS: Final[dict[str, str]] = {}
#: Those of what this thread or task is about: ``job`` and, where it is about one, ``slice``.
_CONCERN: Final[ContextVar[dict[str, str | int]]] = ContextVar("concern")

#: So often a line is written within so many seconds; after that it is counted.
_TOLD_TIMES: Final = 5
_RUN_S: Final = 60.0
#: So many different lines are remembered.
_MOST_RUNS: Final = 1000

#: A value that a line of text shows as it is; others are quoted.
_WORD: Final = re.compile(r"[^\s='\"]+")
#: A log that is longer is begun anew; as much again is in the one before it.
MOST_BYTES: Final = 10_000_000


def set_up(role: str, log_format: LogFormat) -> None:
    """Write every record of this process to standard error, a line each.

    Parameters
    ----------
    role
        What the process is: ``api``, ``monitor`` or ``worker``.
    log_format
        ``text``: time, level and message, then the fields, then an exception's lines. ``json``: an
        object with ``time`` (ISO 8601, UTC), ``level``, ``message``, ``role``, where they apply
        ``worker``, ``monitor``, ``job`` and ``slice``, and ``exception`` as text.

    Notes
    -----
    A line that comes more than five times within a minute is counted from then on. How often it
    came is said ahead of the next line of any kind that follows that minute, or at the end.
    """
    _PROCESS.clear()
    identify(role=role)
    handler = _Counting(sys.stderr)
    handler.setFormatter(_Json() if log_format == "json" else _Text())
    logging.basicConfig(handlers=[handler], level=logging.INFO, force=True)
    logging.captureWarnings(True)


def identify(**fields: str) -> None:
    """Give every line of this process these fields from now on."""
    _PROCESS.update(fields)


@contextmanager
def concerning(job: str, index: int | None = None) -> Iterator[None]:
    """Give this thread's lines the field `job` and, where one is given, `slice` meanwhile.

    An exception that leaves it takes the fields along to whoever logs it, out to the next such
    context or to the thread's end.
    """
    around = concerns()
    concern(job, index)
    yield
    _CONCERN.set(around)


def concern(job: str, index: int | None = None) -> None:
    """As `concerning`, until this thread or task ends or is about something else."""
    _CONCERN.set({"job": job} if index is None else {"job": job, "slice": index})


def concerns() -> dict[str, str | int]:
    """The fields of what this thread or task is about."""
    return _CONCERN.get({})


def printable(text: str) -> str:
    """The text with control characters escaped but for line ends: a scene may have put them there.

    What a terminal would obey (colours, titles, moves of the cursor) is shown instead.
    """
    return "".join(
        letter if letter.isprintable() or letter == "\n" else ascii(letter)[1:-1] for letter in text
    )


if TYPE_CHECKING:
    _StreamHandler = logging.StreamHandler[TextIO]
else:  # before Python 3.11 it is no generic
    _StreamHandler = logging.StreamHandler


@dataclass
class _Run:
    """One line as it comes again and again."""

    first: logging.LogRecord
    times: int = 1

    def summary(self) -> logging.LogRecord:
        """A line that says how often it came, beyond those that were written."""
        said = copy.copy(self.first)
        more = self.times - _TOLD_TIMES
        said.msg = f"{self.first.getMessage()} [{more:,} times more within {_RUN_S:g} s]"
        said.args = said.exc_info = said.exc_text = None
        return said


class _Counting(_StreamHandler):
    """Writes a line a few times and counts it then: who can cause one cannot fill the disk."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._runs: OrderedDict[tuple[object, ...], _Run] = OrderedDict()  # by age

    def emit(self, record: logging.LogRecord) -> None:
        """Write the record, or count it; its fields are those of its thread."""
        fields = record.__dict__["plateau_fields"] = _fields()
        self._end_runs(before=record.created - _RUN_S)
        error = record.exc_info[1] if record.exc_info else None
        about = tuple(fields.items())
        key = (record.name, record.levelno, record.getMessage(), repr(error), about)
        run = self._runs.get(key)
        if run is None:
            if len(self._runs) >= _MOST_RUNS:
                self._end_oldest()
            self._runs[key] = _Run(record)
        else:
            run.times += 1
        if run is None or run.times <= _TOLD_TIMES:
            super().emit(record)

    def close(self) -> None:
        """Say what was counted."""
        with self.lock or nullcontext():
            self._end_runs(before=math.inf)
        super().close()

    def _end_runs(self, before: float) -> None:
        while self._runs and next(iter(self._runs.values())).first.created < before:
            self._end_oldest()

    def _end_oldest(self) -> None:
        _, run = self._runs.popitem(last=False)
        if run.times > _TOLD_TIMES:
            super().emit(run.summary())


class _Json(logging.Formatter):
    """Every record as an object."""

    def format(self, record: logging.LogRecord) -> str:
        fields: dict[str, str | int] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "message": record.getMessage(),
            **record.__dict__["plateau_fields"],
        }
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        return json.dumps(fields, ensure_ascii=False)


class _Text(logging.Formatter):
    """Every record as a line, and an exception below it.

    No message looks like several lines, or like a line of somebody else's.
    """

    def format(self, record: logging.LogRecord) -> str:
        message = printable(" | ".join(record.getMessage().splitlines()))
        fields = (
            f"{name}={_quoted(str(value))}"
            for name, value in record.__dict__["plateau_fields"].items()
        )
        line = " ".join((_time(record), f"[{record.levelname.lower()}]", message, *fields))
        if not record.exc_info:
            return line
        return f"{line}\n{printable(self.formatException(record.exc_info))}"


def _time(record: logging.LogRecord) -> str:
    """When it was made, as ISO 8601 in UTC, to the microsecond."""
    made = datetime.fromtimestamp(record.created, timezone.utc)
    return made.isoformat(timespec="microseconds").replace("+00:00", "Z")


def _fields() -> dict[str, str | int]:
    return {**_PROCESS, **concerns()}


def _quoted(value: str) -> str:
    return value if _WORD.fullmatch(value) and value.isprintable() else repr(value)


def rotate(log: Path, most_bytes: int = MOST_BYTES) -> bool:
    """Begin a log anew that is too long, and keep what it had as ``NAME.log.1``; return whether.

    Who writes to it goes on, in append mode, and need not know. A line that is written between the
    copy and the cut is lost. Where the disk has no room for the copy, there is none.
    """
    try:
        if log.stat().st_size <= most_bytes:
            return False
        with suppress(OSError):
            shutil.copyfile(log, log.with_suffix(".log.1"))
        os.truncate(log, 0)
    except OSError:
        return False  # it is not there, or not ours
    return True
