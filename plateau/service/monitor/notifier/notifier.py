"""Delivers the notices of ended jobs, in threads of a monitor.

All monitors share the outbox. The threads share nothing with the monitor's other work, so a silent
receiver holds up no merge, and no notice to another receiver. A killed monitor loses nothing: its
notices return to the outbox when their leases expire.
"""

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from plateau.errors import ExtraMissing
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.outbox import MOST_TRIES, Outbox, Taken, retry_delay_s
from plateau.farm.model.errors import BlobsUnavailable, StoreUnavailable
from plateau.farm.process import log
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Backoff, Stop
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.notices import TryEnd
from plateau.farm.redis.link import connect
from plateau.farm.redis.wake import Wake
from plateau.farm.wire.notice_views import message
from plateau.service.monitor.notifier.notes import Notes, NotNotified
from plateau.service.monitor.notifier.requests import (
    TOTAL_S,
    NoResponse,
    Requests,
    Response,
    signed_headers,
)
from plateau.service.notices.receivers import Receivers
from plateau.service.notices.targets import read_targets

_LOG = logging.getLogger(__name__)

_MOST: Final = 16  #: notices under way at once,
_MOST_TO_ONE: Final = 2  #: and those to one receiver

_LEASE_S: Final = 2 * TOTAL_S
_POLL_S: Final = 1.0
_RETRY_S: Final = (0.5, 5.0)  #: the first and the longest wait while Redis is away
_GOODBYE_S: Final = 3.0  #: for which a stopping monitor waits for notices under way

_GONE: Final = 410


@contextmanager
def notifying(settings: Settings, store: Blobs | None = None) -> Iterator[None]:
    """Deliver notices in threads while the context lasts; pictures are those in the store."""
    client = connect(settings.redis_url or "")
    notifier = Notifier(
        Outbox(client),
        Wake(client, keys.WAKE_NOTIFIER),
        Requests(Receivers(settings.webhook_allow)),
        _notes(settings, client, store),
        lease_s=_LEASE_S,
    )
    threading.Thread(target=notifier.run, name="notifier", daemon=True).start()
    try:
        yield
    finally:
        notifier.stop()


def _notes(settings: Settings, client: RedisClient, store: Blobs | None) -> Notes:
    jobs = Jobs(client)

    def picture(job_id: str) -> bytes | None:
        results = jobs.results(job_id)
        try:
            return store.get(f"{results}/thumbnail.png") if store and results else None
        except (FileNotFoundError, BlobsUnavailable):  # the words are worth more than the picture
            return None

    return Notes(read_targets(settings), settings.page_url, picture)


class Notifier:
    """Takes due notices from the outbox, tries to deliver them, and records the outcome.

    Parameters
    ----------
    outbox, wake
        The notices, and the hints that a new one came.
    requests
        POSTs those to URLs.
    notes
        Sends those to targets.
    lease_s
        Seconds after which an unrecorded try counts as lost.
    delay_s
        The wait in seconds before the next try, by the number of tries and by ``Retry-After``.
    poll_s
        Seconds between two reads of the outbox without a hint.
    """

    def __init__(
        self,
        outbox: Outbox,
        wake: Wake,
        requests: Requests,
        notes: Notes,
        *,
        lease_s: float,
        delay_s: Callable[[int, float], float] = retry_delay_s,
        poll_s: float = _POLL_S,
    ) -> None:
        self._outbox = outbox
        self._wake = wake
        self._requests = requests
        self._notes = notes
        self._lease_s = lease_s
        self._delay_s = delay_s
        self._poll_s = poll_s
        self._over = Stop()
        self._lock = threading.Lock()
        self._under_way: Counter[str] = Counter()  # by receiver
        self._threads: set[threading.Thread] = set()

    def run(self) -> None:
        """Deliver until `stop` is called."""
        backoff = Backoff(*_RETRY_S)
        while not self._over.is_set():
            try:
                while (taken := self._take()) is not None:
                    self._start(taken)
                self._wake.wait(self._poll_s, self._over)
                backoff.reset()
            except StoreUnavailable as error:
                _LOG.warning("notices wait: %s", error)
                self._over.wait(backoff.delay_s())

    def stop(self) -> None:
        """Take no more, and wait a moment for notices under way; leases recover the rest."""
        self._over.set()
        ends = time.monotonic() + _GOODBYE_S
        with self._lock:
            threads = tuple(self._threads)
        for thread in threads:
            thread.join(max(0.0, ends - time.monotonic()))

    def _take(self) -> Taken | None:
        """Take the next due notice; None if there is none, or too many are under way."""
        with self._lock:
            if self._over.is_set() or self._under_way.total() >= _MOST:
                return None
            busy = {one for one, count in self._under_way.items() if count >= _MOST_TO_ONE}
            taken = self._outbox.take(self._lease_s, busy)
            if taken is not None:
                self._under_way[taken.receiver] += 1
            return taken

    def _start(self, taken: Taken) -> None:
        thread = threading.Thread(target=self._go_on, args=(taken,), name="notice", daemon=True)
        with self._lock:
            self._threads.add(thread)
        thread.start()

    def _go_on(self, taken: Taken | None) -> None:
        """Deliver this one, and then whatever is due."""
        try:
            while taken is not None:
                try:
                    with log.concerning(taken.job_id):
                        self._deliver(taken)
                finally:
                    self._done_with(taken.receiver)
                taken = self._take()
        except StoreUnavailable as error:
            _LOG.warning("notices wait: %s", error)
        finally:
            with self._lock:
                self._threads.discard(threading.current_thread())

    def _done_with(self, receiver: str) -> None:
        with self._lock:
            self._under_way[receiver] -= 1
            if not self._under_way[receiver]:
                del self._under_way[receiver]

    def _deliver(self, taken: Taken) -> None:
        started = time.monotonic()
        answer, error = self._tried(taken)
        end = _end_of(taken, answer, error)
        asked_s = 0.0 if answer is None else answer.retry_after_s
        delay_s = self._delay_s(taken.tries, asked_s) if end == "failed" else 0.0
        settled = self._settle(taken, end, error, delay_s)
        _report(taken, end, error, time.monotonic() - started, delay_s, settled=settled)

    def _tried(self, taken: Taken) -> tuple[Response | None, str]:
        """Send the notice; returns the answer, if any, and the error unless it was delivered."""
        try:
            if taken.url is None:
                self._notes.tell(taken)
                return None, ""
            body = message(taken.job).model_dump_json().encode()
            headers = signed_headers(f"msg_{taken.job_id}", taken.now, body, taken.secret)
            answer = self._requests.post(taken.url, headers, body)
        except (NoResponse, NotNotified, ExtraMissing) as error:
            return None, str(error)
        except Exception as error:  # noqa: BLE001  (one notice must not hurt the others)
            _LOG.exception("a notice could not be sent")
            return None, f"it could not be sent: {type(error).__name__}; the monitor's log has more"
        if 200 <= answer.status < 300:
            return answer, ""
        if 300 <= answer.status < 400:
            return answer, f"the receiver answered {answer.status}; redirects are not followed"
        return answer, f"the receiver answered {answer.status}"

    def _settle(self, taken: Taken, end: TryEnd, error: str, delay_s: float) -> bool:
        """Record the outcome, retrying while the lease lasts; False if the lease was lost."""
        ends = time.monotonic() + self._lease_s
        backoff = Backoff(*_RETRY_S)
        while True:
            try:
                return self._outbox.settle(taken, end, error, delay_s)
            except StoreUnavailable:
                if time.monotonic() > ends or self._over.wait(backoff.delay_s()):
                    raise


def _end_of(taken: Taken, answer: Response | None, error: str) -> TryEnd:
    if not error:
        return "delivered"
    if taken.tries >= MOST_TRIES or (answer is not None and answer.status == _GONE):
        return "given-up"
    return "failed"


def _report(
    taken: Taken, end: TryEnd, error: str, took_s: float, delay_s: float, *, settled: bool
) -> None:
    """Log how a try ended; of the URL only the host, because its path may be confidential."""
    what = f"the notice of job {taken.job_id} to {taken.receiver}"
    if not settled:
        _LOG.warning("%s: its lease ran out after %.1f s", what, took_s)
    elif end == "delivered":
        _LOG.info("%s: delivered by try %d in %.1f s", what, taken.tries, took_s)
    elif end == "failed":
        _LOG.warning("%s: %s; try %d follows in %.0f s", what, error, taken.tries + 1, delay_s)
    else:
        _LOG.warning("%s: %s; given up after %d tries", what, error, taken.tries)
