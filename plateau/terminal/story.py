"""The story of a job and the log of its slices, in lines for people."""

from collections.abc import Iterable, Iterator
from datetime import datetime
from operator import itemgetter
from typing import Final

from plateau.farm.model.job import Event, LogEntry
from plateau.farm.model.states import JobState
from plateau.farm.process.letters import printable
from plateau.farm.wire import figures

#: Of many troubles, a story shows this many from the beginning and from the end.
_FIRST: Final = 4
_LAST: Final = 8
_LONGEST_CAUSE: Final = 200


def story(job_id: str, events: Iterable[Event], log: Iterable[LogEntry]) -> list[str]:
    """The state changes of the job and its troubles, one line each, by time.

    Troubles are workers that died on a slice, lost partials, and workers that found that they
    cannot render. If there are many, only the first and the last are shown.
    """
    events = list(events)
    moves = [
        (event.at, f"{_state(event)}: {printable(str(event.data['reason']))}")
        for event in events
        if event.type == "state"
    ]
    troubles = [
        (event.at, _trouble(event.data["index"], event.data["worker"], event.data["cause"]))
        for event in events
        if event.type == "trouble"
    ]
    troubles += [
        (one.at, _trouble(one.slice, one.worker, f"out of service: {one.cause}"))
        for one in log
        if one.what == "unfit"
    ]
    troubles.sort(key=itemgetter(0))
    hidden = troubles[_FIRST:-_LAST]
    if hidden:
        more = (hidden[0][0], f"  … and {len(hidden)} more troubles: plateau log {job_id}")
        troubles = [*troubles[:_FIRST], more, *troubles[-_LAST:]]
    # Of two lines of the same time the trouble comes first: it is the cause.
    lines = sorted([*troubles, *moves], key=itemgetter(0))
    return [f"{_time(at)}  {text}" for at, text in lines]


def log_lines(entries: Iterable[LogEntry]) -> Iterator[str]:
    """Each try as a line, followed by the renderer's output, indented."""
    for one in entries:
        took = "" if one.seconds is None else f" after {figures.duration(one.seconds)}"
        cause = "" if one.cause is None else f": {_in_a_line(one.cause)}"
        yield f"{_time(one.at)}  slice {one.slice}  {one.what}{took} by {one.worker}{cause}"
        yield from (f"    {line}" for line in printable(one.text).splitlines())


def _state(event: Event) -> str:
    return JobState(event.data["to"]).in_words


def _trouble(index: object, worker: object, cause: object) -> str:
    return f"  slice {index}, worker {worker}: {_in_a_line(str(cause))}"


def _in_a_line(text: str) -> str:
    line = printable(" | ".join(filter(None, map(str.strip, text.splitlines()))))
    return line if len(line) <= _LONGEST_CAUSE else f"{line[: _LONGEST_CAUSE - 1]}…"


def _time(at: datetime) -> str:
    return f"{at:%Y-%m-%d %H:%M:%S} UTC"
