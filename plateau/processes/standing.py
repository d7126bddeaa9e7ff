"""The API as a process of its farm: whether its version fits."""

import logging
import os
import signal
import threading

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import await_checks, check_schema
from plateau.farm.model.errors import FarmError, Incompatible, StoreUnavailable, WrongStore
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect

_LOG = logging.getLogger("plateau")


class Standing:
    """The checks of `processes.process.when_checked`, for an API that may start without Redis.

    Without Redis the API answers 503. It is checked once Redis answers. `stop` ends the wait.

    Raises
    ------
    Incompatible, WrongStore
        By the constructor if Redis answers; otherwise by `end`, after the API was asked to stop.
    """

    def __init__(self, settings: Settings, stop: threading.Event) -> None:
        self._client = connect(settings.redis_url or "")
        self._store = Blobs(settings.blobs or "")
        self._stop = stop
        self._refusal: FarmError | None = None
        self._thread: threading.Thread | None = None
        try:
            check_schema(self._client)
            check_pair(self._client, self._store)
        except StoreUnavailable as error:
            _LOG.warning("%s; the API starts without it", error)
            self._thread = threading.Thread(target=self._check, name="standing", daemon=True)

    def start(self) -> None:
        """Start the thread that checks, if that is still to be done; it can stop the API."""
        if self._thread is not None:
            self._thread.start()

    def end(self) -> None:
        """Raise the error of a failed check."""
        self._stop.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        if self._refusal is not None:
            raise self._refusal

    def _check(self) -> None:
        try:
            await_checks(self._client, self._store, self._stop)
        except (Incompatible, WrongStore) as refusal:
            self._refusal = refusal
            os.kill(os.getpid(), signal.SIGTERM)
