"""What happened to a job and to its slices, in lines for people."""

from collections.abc import Iterable, Iterator
from datetime import datetime
from itertools import chain
from typing import Final

from plateau.farm.model.job import Event, LogEntry
from plateau.farm.process.log import printable
from plateau.farm.wire import figures

#: A story tells so many troubles: the first ones, and the last ones.
_FIRST: Final = 4
_LAST: Final = 8
_LONGEST_CAUSE: Final = 200


def story(job_id: str, events: Iterable[Event], log: Iterable[LogEntry]) -> list[str]:
    """Each move of the job with its time and cause, and its troubles among them; a line each.

    Troubles are workers that died on a slice, partials that were lost, and workers that found that
    they can render nothing. Of many, only the first and the last are told.
    """
    events = list(events)
    moves = [
        (event.at, f"{event.data['to']}: {printable(str(event.data['reason']))}")
        for event in events
        if event.type == "state"
    ]
    troubles = sorted(
        chain(
            (
                (event.at, _trouble(event.data["index"], event.data["worker"], event.data["cause"]))
                for event in events
                if event.type == "trouble"
            ),
            (
                (one.at, _trouble(one.slice, one.worker, f"out of service: {one.cause}"))
                for one in log
                if one.what == "unfit"
            ),
        ),
        key=lambda told: told[0],
    )
    untold = troubles[_FIRST:-_LAST]
    if untold:
        more = (untold[0][0], f"  … and {len(untold)} more troubles: plateau log {job_id}")
        troubles = [*troubles[:_FIRST], more, *troubles[-_LAST:]]
    # At one time, the trouble is the cause.
    told = sorted([*troubles, *moves], key=lambda line: line[0])
    return [f"{_time(at)}  {text}" for at, text in told]


def log_lines(entries: Iterable[LogEntry]) -> Iterator[str]:
    """Each try's end as a line, followed by what was printed meanwhile, indented."""
    for one in entries:
        took = "" if one.seconds is None else f" after {figures.duration(one.seconds)}"
        cause = "" if one.cause is None else f": {_in_a_line(one.cause)}"
        yield f"{_time(one.at)}  slice {one.slice}  {one.what}{took} by {one.worker}{cause}"
        yield from (f"    {line}" for line in printable(one.text).splitlines())


def _trouble(index: object, worker: object, cause: object) -> str:
    return f"  slice {index}, worker {worker}: {_in_a_line(str(cause))}"


def _in_a_line(text: str) -> str:
    line = printable(" | ".join(filter(None, map(str.strip, text.splitlines()))))
    return line if len(line) <= _LONGEST_CAUSE else f"{line[: _LONGEST_CAUSE - 1]}…"


def _time(at: datetime) -> str:
    return f"{at:%Y-%m-%d %H:%M:%S} UTC"
