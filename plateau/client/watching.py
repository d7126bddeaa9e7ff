"""Calls that follow a job while it runs."""

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Final

import httpx

from plateau.client.errors import ClientError, TimedOut
from plateau.client.events import FinishedEvent, typed
from plateau.client.transport import Calls, Patience
from plateau.farm.model.job import BEFORE_ALL_EVENTS, Event
from plateau.farm.wire.views import Happened, JobView

#: The service sends at least a comment every 15 s while a stream of events is open.
_SILENCE_S: Final = 45.0
#: A stream that was open for this long shows that the service was there.
_LASTING_S: Final = 5.0
#: A stream may outlast the deadline by this much before it is reopened with a shorter time-out.
_LATE_S: Final = 1.0


class WatchingCalls(Calls):
    """The events of a job, as they happen.

    A call that takes a job's id raises `ApiError` ``unknown-job`` if there is none.
    """

    def events(
        self, job_id: str, after: str = BEFORE_ALL_EVENTS, *, timeout_s: float | None = None
    ) -> Iterator[Event]:
        """The events of the job from its beginning to `FinishedEvent`.

        A broken connection is reopened after the last event, so each event comes once.

        Parameters
        ----------
        job_id
            The job.
        after
            The `id` of an event: yield only later ones. A finished job may have none.
        timeout_s
            For how long to listen, in seconds; None for ever.

        Yields
        ------
        Event
            One of the types in `plateau.client.events`; a plain `Event` if the type is unknown.

        Raises
        ------
        TimedOut
            The job was not finished in time.
        """
        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        patience = Patience(self._transport)
        while True:
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise TimedOut(f"job {job_id}", timeout_s or 0.0)
            read_s, began, has_opened = min(_SILENCE_S, left_s), time.monotonic(), False
            try:
                with self._transport.stream(
                    f"/v1/jobs/{job_id}/events", read_s=read_s, headers={"Last-Event-ID": after}
                ) as answer:
                    if answer.status_code == httpx.codes.NO_CONTENT:
                        return
                    has_opened = True
                    lines = _in_time(answer.iter_lines(), deadline, read_s)
                    for event in map(typed, parse_events(lines)):
                        yield event
                        after = event.id
                        patience.renew()
                        if isinstance(event, FinishedEvent):
                            return
                patience.renew()
            except ClientError as error:
                if has_opened and time.monotonic() > began + _LASTING_S:  # it was there until now
                    patience.renew()
                patience.wait_after(error, at_most_s=deadline - time.monotonic())

    def happened(self, job_id: str) -> list[Event]:
        """The events of the job so far, with the types of `events`."""
        headers = {"Accept": "application/json"}
        happened = self._transport.read(Happened, f"/v1/jobs/{job_id}/events", headers=headers)
        return [typed(event) for event in happened.events]

    def wait(
        self,
        job_id: str,
        *,
        timeout_s: float | None = None,
        on_event: Callable[[Event], object] | None = None,
    ) -> JobView:
        """The job once it is finished: ended in any state, with its results written.

        Parameters
        ----------
        job_id
            The job.
        timeout_s
            For how long to wait, in seconds; None for ever.
        on_event
            Called in this thread with each event of the job, from its first; an exception ends it.

        Raises
        ------
        TimedOut
            The job was not finished in time; it continues.
        """
        for event in self.events(job_id, timeout_s=timeout_s):
            if on_event is not None:
                on_event(event)
        return self._transport.read(JobView, f"/v1/jobs/{job_id}")


def _in_time(lines: Iterable[str], deadline: float, read_s: float) -> Iterator[str]:
    """The lines, until another silence of `read_s` would end too late after the deadline."""
    for line in lines:
        yield line
        left_s = deadline - time.monotonic()
        if not line and (left_s <= 0 or left_s < read_s - _LATE_S):
            return


def parse_events(lines: Iterable[str]) -> Iterator[Event]:
    """The events in the lines of a stream: the part of the HTML standard that Plateau uses.

    An event that a broken connection cuts short is left out.
    """
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")  # a comment has no name
            fields[name] = value.removeprefix(" ")
            continue
        if {"id", "event", "data"} <= fields.keys():
            data = json.loads(fields["data"])
            yield Event(id=fields["id"], type=fields["event"], data=data, at=data["at"])
        fields = {}
