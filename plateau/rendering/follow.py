"""Follows a job to its end and shows its progress."""

import math
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from plateau.client import Client, ClientError
from plateau.farm.model.job import Event
from plateau.farm.model.states import JobState
from plateau.farm.wire.views import JobView
from plateau.processes.interrupts import Interrupts
from plateau.terminal.progress import Progress

_TICK_S: Final = 0.2
_SHOW_S: Final = 1.0  #: between two updates of the shown times
#: Between two requests for the job: after a new slice, and without any event.
_AFTER_A_SLICE_S: Final = 1.0
_WITHOUT_EVENT_S: Final = 10.0
#: A cancelled job whose results are not there by then has nobody who writes them.
_CANCEL_S: Final = 300.0


#: Called a few times a second, and with each event of the job.
Tick = Callable[[Event | None], None]


def follow(client: Client, job_id: str, shown: Progress, tick: Tick) -> JobView:
    """The job once it is finished; `tick` is called in this thread."""
    happened: queue.SimpleQueue[Event | Exception | None] = queue.SimpleQueue()

    def listen() -> None:
        try:
            for event in client.events(job_id):
                happened.put(event)
            happened.put(None)
        except Exception as error:  # noqa: BLE001  (raised below, in the other thread)
            happened.put(error)

    threading.Thread(target=listen, name="events", daemon=True).start()
    with shown:
        job, fetched_at = _fetch(client, job_id, shown)
        shown_at, is_stale = fetched_at, False
        item: Any = None
        while True:
            tick(item)
            try:
                item = happened.get(timeout=_TICK_S)
            except queue.Empty:
                item = None
                if time.monotonic() > shown_at + _SHOW_S:
                    shown.refresh()
                    shown_at = time.monotonic()
            else:
                if isinstance(item, Exception):
                    raise item
                if item is None:
                    break
                is_stale = True
                if item.type != "slice":
                    job, fetched_at = _fetch(client, job_id, shown)
                    is_stale = False
                shown.event(item)
            if time.monotonic() > fetched_at + (_AFTER_A_SLICE_S if is_stale else _WITHOUT_EVENT_S):
                job, fetched_at = _fetch(client, job_id, shown)
                is_stale = False
        job, _ = _fetch(client, job_id, shown)
    return job


def cancelling(client: Client, job_id: str, interrupts: Interrupts, shown: Progress) -> Tick:
    """A tick for `follow`: an interrupt cancels the job; a second or a long wait raises."""
    asked_at = math.inf

    def tick(_: Event | None) -> None:
        nonlocal asked_at
        if interrupts.asked.is_set() and asked_at == math.inf:
            asked_at = time.monotonic()
            shown.note("cancelling; the results so far are kept; interrupt again to leave at once")
            try:
                client.cancel(job_id)
            except ClientError as error:
                ended = getattr(error, "slug", "") == "cannot-cancel"  # a moment ago
                if not (ended or interrupts.insisted.is_set()):
                    raise
        if interrupts.insisted.is_set() or time.monotonic() > asked_at + _CANCEL_S:
            raise KeyboardInterrupt

    return tick


def worth_keeping(job: JobView, interrupts: Interrupts) -> JobView:
    """The job; raises `KeyboardInterrupt` where that ended it before it had an image."""
    if interrupts.asked.is_set() and job.state is JobState.CANCELLED and job.image_spp is None:
        raise KeyboardInterrupt
    return job


def _fetch(client: Client, job_id: str, shown: Progress) -> tuple[JobView, float]:
    """Fetch and show the job; returns it and the time."""
    job = client.job(job_id)
    shown.job(job)
    return job, time.monotonic()
