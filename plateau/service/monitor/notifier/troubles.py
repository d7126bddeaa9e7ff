"""Tells the operator's targets of troubles: what holds up jobs and does not mend itself."""

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from plateau.errors import ExtraMissing
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.troubles import ToldTroubles, Trouble, of_farm, of_store
from plateau.farm.model.errors import FarmError, StoreUnavailable
from plateau.farm.process.settings import Settings
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import connect
from plateau.service.monitor.notifier.notes import Note, NotNotified, send
from plateau.service.notices.targets import Targets

_LOG = logging.getLogger(__name__)

_POLL_S: Final = 15.0
#: For how long a trouble lasts before it is told.
_PATIENCE_S: Final = 120.0
#: A monitor that was to tell of a trouble and did not has failed, or was lost, after this time.
_LEASE_S: Final = 120.0


@contextmanager
def telling_troubles(settings: Settings, store: Blobs, targets: Targets) -> Iterator[None]:
    """Look for troubles in a thread while the context lasts, where somebody is to be told."""
    over = threading.Event()
    if targets.troubles:
        client = connect(settings.redis_url or "")
        teller = Teller(client, store, targets, _PATIENCE_S, settings.page_url, poll_s=_POLL_S)
        threading.Thread(target=teller.run, args=(over,), name="troubles", daemon=True).start()
    try:
        yield
    finally:
        over.set()


class Teller:
    """Tells each target of each trouble once, until it is over.

    Parameters
    ----------
    client, store
        Redis and the blob store, which are checked.
    targets
        Who is told.
    patience_s
        For how long a trouble lasts before it is told.
    url
        Of the farm's page, if it is set.
    poll_s, lease_s
        Between two checks, and after a try to tell.
    """

    def __init__(
        self,
        client: RedisClient,
        store: Blobs,
        targets: Targets,
        patience_s: float,
        url: str | None = None,
        *,
        poll_s: float = _POLL_S,
        lease_s: float = _LEASE_S,
    ) -> None:
        self._redis = client
        self._store = store
        self._targets = targets
        self._patience_s = patience_s
        self._url = url
        self._poll_s = poll_s
        self._told = ToldTroubles(client, patience_s, lease_s)
        self._away_since: float | None = None  # Redis, which then remembers nothing
        self._told_of_redis: set[str] = set()

    def run(self, over: threading.Event) -> None:
        """Check and tell until `over` is set, through any error."""
        while not over.wait(self._poll_s):
            try:
                self.check()
            except StoreUnavailable as error:
                self._without_redis(error)
            except FarmError as error:
                _LOG.warning("troubles are not told: %s", error)
            except Exception:  # noqa: BLE001  (the monitor's jobs must continue)
                _LOG.exception("troubles are not told")

    def check(self) -> None:
        """Check once, and tell what is due."""
        troubles = of_farm(self._redis), of_store(self._store)
        due = self._told.to_tell(*troubles, self._targets.troubles)
        self._away_since = None
        self._told_of_redis.clear()
        for field, target, trouble in due:
            if self._tell(target, trouble):
                self._told.told(field)

    def _without_redis(self, error: StoreUnavailable) -> None:
        """Tell by this monitor's own memory."""
        now = time.monotonic()
        self._away_since = now if self._away_since is None else self._away_since
        if now < self._away_since + self._patience_s:
            return
        trouble = Trouble("redis", f"Redis cannot be used: {error}")
        for target in {*self._targets.troubles} - self._told_of_redis:
            if self._tell(target, trouble):
                self._told_of_redis.add(target)

    def _tell(self, target: str, trouble: Trouble) -> bool:
        link = f"{self._url.rstrip('/')}/jobs/{trouble.job}" if self._url and trouble.job else ""
        body = "\n".join(filter(None, (trouble.words, link)))
        try:
            send(target, self._targets.url(target), Note("Plateau: a trouble", body))
        except (NotNotified, ExtraMissing) as error:
            _LOG.warning("%s; a trouble: %s", error, trouble.words)
            return False
        _LOG.warning("%s was told of a trouble: %s", target, trouble.words)
        return True
