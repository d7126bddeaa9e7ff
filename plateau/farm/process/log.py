"""Structured logs: every line of a Plateau process names its writer and its subject.

Modules use `logging` as usual. Each record, a library's too, gets the fields of the process
(``role``, ``worker`` or ``monitor``) and of the thread's subject (``job``, ``slice``), and is
written as a line for people or for programs.
"""

import json
import logging
import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import datetime, timezone
from pathlib import Path
from typing import Final, Literal

from plateau.farm.process.letters import printable

LogFormat = Literal["text", "json"]

#: The fields of this process, the same in all its threads.
_PROCESS: Final[dict[str, str]] = {}
#: The fields of this thread's or task's subject: ``job`` and, if any, ``slice``.
_CONCERN: Final[ContextVar[dict[str, str | int]]] = ContextVar("concern")

#: A value that a line of text shows as it is; others are quoted.
_WORD: Final = re.compile(r"[^\s='\"]+")
#: A longer log is rotated; the file of older lines is at most as long.
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
    """Give this thread's lines the field `job` and, if given, `slice`, within the context.

    After an exception the fields stay, for the line that logs it, until the next such context.
    """
    around = concerns()
    concern(job, index)
    yield
    _CONCERN.set(around)


def concern(job: str, index: int | None = None) -> None:
    """As `concerning`, until this thread or task ends or gets another subject."""
    _CONCERN.set({"job": job} if index is None else {"job": job, "slice": index})


def concerns() -> dict[str, str | int]:
    """The fields of this thread's or task's subject."""
    return _CONCERN.get({})


def _fields() -> dict[str, str | int]:
    return {**_PROCESS, **concerns()}


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
    """Every record as a line, and an exception below it; no message can forge a line."""

    def format(self, record: logging.LogRecord) -> str:
        message = printable(" | ".join(record.getMessage().splitlines()))
        fields = (f"{name}={_quoted(str(value))}" for name, value in _fields().items())
        line = " ".join((_time(record), f"[{record.levelname.lower()}]", message, *fields))
        if not record.exc_info:
            return line
        return f"{line}\n{printable(self.formatException(record.exc_info))}"


def _time(record: logging.LogRecord) -> str:
    """The record's time as ISO 8601 in UTC, to the microsecond."""
    made = datetime.fromtimestamp(record.created, timezone.utc)
    return made.isoformat(timespec="microseconds").replace("+00:00", "Z")


def _quoted(value: str) -> str:
    return value if _WORD.fullmatch(value) and value.isprintable() else repr(value)


def rotate(log: Path, most_bytes: int = MOST_BYTES) -> bool:
    """Move the lines of a log that is too long to ``NAME.log.1``; return whether it was.

    A process that writes to it in append mode notices nothing. A line written between the copy and
    the cut is lost. A disk without room for the copy gets none.
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
