"""Structured logs: every line of a Plateau process says who wrote it and what it is about.

Modules log by `logging` as ever. Here, once for each process, every record (a library's too) is
given the process's own fields (``role``, ``worker`` or ``monitor``) and those of what the thread is
about at the time (``job``, ``slice``), and is written as a line for people or for programs.
"""

import json
import logging
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import datetime, timezone
from typing import Final

from farm.settings import LogFormat

#: The fields of this process: who it is does not depend on what any of its threads is about.
_PROCESS: Final[dict[str, str]] = {}
#: Those of what this thread or task is about: ``job`` and, where it is about one, ``slice``.
_CONCERN: Final[ContextVar[dict[str, str | int]]] = ContextVar("concern")

#: A value that a line of text shows as it is; others are quoted.
_WORD: Final = re.compile(r"[^\s='\"]+")


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
    """
    _PROCESS.clear()
    identify(role=role)
    handler = logging.StreamHandler(sys.stderr)
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


class _Json(logging.Formatter):
    """Every record as an object."""

    def format(self, record: logging.LogRecord) -> str:
        fields: dict[str, str | int] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "message": record.getMessage(),
            **_fields(),
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
        fields = (f"{name}={_quoted(str(value))}" for name, value in _fields().items())
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
