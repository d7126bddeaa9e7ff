"""Follow a job to its end, showing what happens."""

import queue
import threading
import time
from collections.abc import Callable
from typing import Final

from plateau.client import Client
from plateau.farm.model.job import Event
from plateau.farm.wire.views import JobView
from plateau.terminal.progress import Progress

_TICK_S: Final = 0.2
_SHOW_S: Final = 1.0  #: between two looks at the clock for who watches
_AFTER_A_SLICE_S: Final = 1.0  #: from one look at the job to the next, where there is a new slice,
_WITHOUT_NEWS_S: Final = 10.0  #: and where nothing happened


def follow(client: Client, job_id: str, shown: Progress, tick: Callable[[], None]) -> JobView:
    """The job once it is finished; `tick` is called a few times a second, in this thread.

    Raises
    ------
    ClientError
        The job is not known, or the service is gone for longer than the client is patient.
    """
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
        while True:
            tick()
            try:
                item = happened.get(timeout=_TICK_S)
            except queue.Empty:
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
            if time.monotonic() > fetched_at + (_AFTER_A_SLICE_S if is_stale else _WITHOUT_NEWS_S):
                job, fetched_at = _fetch(client, job_id, shown)
                is_stale = False
        job, _ = _fetch(client, job_id, shown)
    return job


def _fetch(client: Client, job_id: str, shown: Progress) -> tuple[JobView, float]:
    """The job as it stands, shown, and when that was."""
    job = client.job(job_id)
    shown.job(job)
    return job, time.monotonic()
