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

#: The service says something every 15 s while a stream of events is open.
_SILENCE_S: Final = 45.0
#: By so much a time-out may be overstepped before the stream is opened anew with a shorter one.
_LATE_S: Final = 1.0


class WatchingCalls(Calls):
    """What happens to a job, as it happens."""

    def events(
        self, job_id: str, after: str = BEFORE_ALL_EVENTS, *, timeout_s: float | None = None
    ) -> Iterator[Event]:
        """What happens to the job, from its beginning on, up to and including `FinishedEvent`.

        A connection that breaks is made again, from the last event on, so each event comes once.

        Parameters
        ----------
        job_id
            The job.
        after
            The `id` of an event: only what follows it. Of a finished job there may be nothing.
        timeout_s
            For how long to listen, in seconds; for ever where it is None.

        Yields
        ------
        Event
            One of `plateau.client.events`: `StateEvent`, `PointEvent`, `SliceEvent`,
            `TroubleEvent`, `FinishedEvent`; a plain `Event` where a newer service has more.

        Raises
        ------
        ApiError
            ``unknown-job``.
        TimedOut
            It was not finished in time.
        """
        deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
        patience = Patience(self._transport)
        while True:
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise TimedOut(f"job {job_id}", timeout_s or 0.0)
            read_s = min(_SILENCE_S, left_s)
            try:
                with self._transport.stream(
                    f"/v1/jobs/{job_id}/events", read_s=read_s, headers={"Last-Event-ID": after}
                ) as answer:
                    if answer.status_code == httpx.codes.NO_CONTENT:
                        return
                    lines = _in_time(answer.iter_lines(), deadline, read_s)
                    for event in map(typed, parse_events(lines)):
                        yield event
                        after = event.id
                        patience.renew()
                        if isinstance(event, FinishedEvent):
                            return
                patience.renew()
            except ClientError as error:
                patience.wait_after(error, at_most_s=deadline - time.monotonic())

    def happened(self, job_id: str) -> list[Event]:
        """What has happened to the job so far, typed as `events` types it.

        Raises
        ------
        ApiError
            ``unknown-job``.
        """
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
        """The job once it is finished: ended, with its results written.

        Look at its `state`: it may have converged, or be exhausted, cancelled or failed.

        Parameters
        ----------
        job_id
            The job.
        timeout_s
            For how long to wait, in seconds; for ever where it is None.
        on_event
            Called with each event from the job's beginning on, in this thread; what it raises ends
            the wait.

        Raises
        ------
        ApiError
            ``unknown-job``.
        TimedOut
            It was not finished in time; it goes on.
        """
        for event in self.events(job_id, timeout_s=timeout_s):
            if on_event is not None:
                on_event(event)
        return self._transport.read(JobView, f"/v1/jobs/{job_id}")


def _in_time(lines: Iterable[str], deadline: float, read_s: float) -> Iterator[str]:
    """The lines, until another silence of `read_s` would end too long after the deadline."""
    for line in lines:
        yield line
        left_s = deadline - time.monotonic()
        if not line and (left_s <= 0 or left_s < read_s - _LATE_S):
            return


def parse_events(lines: Iterable[str]) -> Iterator[Event]:
    """The events in the lines of a stream, by the rules of the HTML standard that Plateau uses.

    An event that is cut short, by a connection that breaks, is left out.
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
