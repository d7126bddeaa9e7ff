"""The API as a process of its farm: whether its version fits, and its heartbeat."""

import logging
import os
import signal
import threading
from contextlib import suppress

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.members import Membership, sign_on
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import await_checks, await_schema
from plateau.farm.model.errors import FarmError, Incompatible, StoreUnavailable, WrongStore
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect

_LOG = logging.getLogger("plateau")


class Standing:
    """The checks of `processes.process.when_checked`, for an API that may start without Redis.

    While Redis is away, the API answers 503. It is checked when Redis first answers, and sends
    heartbeats from then on. `stop` ends the waits.

    Raises
    ------
    Incompatible, WrongStore
        By the constructor if Redis answers; otherwise by `end`, after the API was asked to stop.
    """

    def __init__(self, settings: Settings, stop: threading.Event) -> None:
        self._client = connect(settings.redis_url or "")
        self._store = Blobs(settings.blobs or "")
        self._membership = Membership(self._client, settings.lease_s)
        self._every_s = settings.lease_s / 3
        self._patient = settings.when_refused == "wait"
        self._stop = stop
        self._refusal: FarmError | None = None
        self._is_checked = False
        try:
            await_schema(self._client, stop, patient=self._patient)
            check_pair(self._client, self._store)
            self._sign_on()
            self._is_checked = True
        except StoreUnavailable as error:
            _LOG.warning("%s; the API starts without it", error)
        self._thread = threading.Thread(target=self._keep, name="standing", daemon=True)

    def start(self) -> None:
        """Start the thread that checks and sends heartbeats; from now on it can stop the API."""
        self._thread.start()

    def end(self) -> None:
        """Sign off; raise the error of a failed check."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._refusal is not None:
            raise self._refusal
        with suppress(FarmError):
            self._membership.sign_off()

    def _keep(self) -> None:
        try:
            if not self._is_checked:
                await_checks(self._client, self._store, self._stop, patient=self._patient)
            while not self._stop.is_set():
                try:
                    self._sign_on()
                except StoreUnavailable as error:
                    _LOG.warning("no heartbeat: %s", error)
                self._stop.wait(self._every_s)
        except (Incompatible, WrongStore) as refusal:
            self._refusal = refusal
            os.kill(os.getpid(), signal.SIGTERM)

    def _sign_on(self) -> None:
        sign_on(self._client, "api", self._membership.heartbeat, self._stop, patient=self._patient)
