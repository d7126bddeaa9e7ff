"""Structured logs: every line of a Plateau process says who wrote it and what it is about.

Modules log by `logging` as ever. Here, once for each process, every record (a library's too) is
given the process's own fields (``role``, ``worker`` or ``monitor``) and those of what the thread is
about at the time (``job``, ``slice``), and is written as a line for people or for programs.
"""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import structlog
from structlog.typing import EventDict, Processor

from farm.settings import LogFormat

#: The fields of this process: who it is does not depend on what any of its threads is about.
_PROCESS: Final[dict[str, str]] = {}


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
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[
                structlog.contextvars.merge_contextvars,
                _add_process,
                structlog.stdlib.add_log_level,
                structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
                structlog.processors.EventRenamer("message"),
            ],
            processors=[
                structlog.stdlib.ProcessorFormatter.remove_processors_meta,
                structlog.processors.format_exc_info,
                *(_as_json() if log_format == "json" else _as_text()),
            ],
        )
    )
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
    around = structlog.contextvars.get_contextvars()
    concern(job, index)
    yield
    structlog.contextvars.clear_contextvars()
    structlog.contextvars.bind_contextvars(**around)


def concern(job: str, index: int | None = None) -> None:
    """As `concerning`, until this thread or task ends or is about something else."""
    structlog.contextvars.bind_contextvars(job=job)
    if index is None:
        structlog.contextvars.unbind_contextvars("slice")
    else:
        structlog.contextvars.bind_contextvars(slice=index)


def printable(text: str) -> str:
    """The text with control characters escaped but for line ends: a scene may have put them there.

    What a terminal would obey (colours, titles, moves of the cursor) is shown instead.
    """
    return "".join(
        letter if letter.isprintable() or letter == "\n" else ascii(letter)[1:-1] for letter in text
    )


def _add_process(_logger: object, _method: str, event: EventDict) -> EventDict:
    about = {name: event.pop(name) for name in ("job", "slice") if name in event}
    return {**event, **_PROCESS, **about}


def _as_json() -> tuple[Processor, ...]:
    return (
        _in_order,
        structlog.processors.JSONRenderer(ensure_ascii=False),
    )


def _in_order(_logger: object, _method: str, event: EventDict) -> EventDict:
    first = {name: event.pop(name) for name in ("time", "level", "message")}
    return {**first, **event}


def _as_text() -> tuple[Processor, ...]:
    return (
        _presentable,
        structlog.dev.ConsoleRenderer(
            colors=False,
            pad_level=False,
            pad_event_to=0,
            event_key="message",
            timestamp_key="time",
            sort_keys=False,
            exception_formatter=structlog.dev.plain_traceback,
        ),
    )


def _presentable(_logger: object, _method: str, event: EventDict) -> EventDict:
    """Keep a message from looking like several lines, or like a line of somebody else's."""
    event["message"] = printable(" | ".join(str(event["message"]).splitlines()))
    if "exception" in event:
        event["exception"] = printable(event["exception"])
    return event
