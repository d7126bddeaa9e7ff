"""Tells the queue why slices were not rendered, and repeats this until Redis answers."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.waits import Backoff

_LOG = logging.getLogger(__name__)

RETRY_S: Final = (0.5, 10.0)  #: the first and the longest wait while Redis is away
DRAIN_S: Final = 5.0  #: how long a stopping worker tries


@dataclass(frozen=True)
class Tried:
    """The cost of a try of a slice, and what the render child printed meanwhile."""

    seconds: float
    said: str


class Reports:
    """One worker's reports.

    While Redis is away they are repeated until the worker stops: a lease that ran out would count
    as a worker that died on the slice.
    """

    def __init__(self, slices: SliceQueue, stop: threading.Event) -> None:
        self._queue = slices
        self._stop = stop

    def hand_back(
        self,
        lease: Lease,
        cause: str,
        tried: Tried,
        *,
        unfit: bool = False,
        leaves_out: bool = False,
    ) -> None:
        """Give the slice back untouched, as `SliceQueue.hand_back` does."""
        about = {"cause": cause, "said": tried.said}
        self._insist(
            lambda: self._queue.hand_back(
                lease, tried.seconds, **about, unfit=unfit, leaves_out=leaves_out
            )
        )

    def died(self, lease: Lease, cause: str, tried: Tried) -> None:
        """Report that the render child died on the slice."""
        self._insist(lambda: self._queue.died(lease, cause, tried.seconds, tried.said))

    def fail(self, lease: Lease, reason: str, tried: Tried) -> None:
        """Fail the job: no worker can render its scene."""
        self._insist(lambda: self._queue.fail(lease, reason, tried.seconds, tried.said))

    def _insist(self, report: Callable[[], object]) -> None:
        backoff, stopping_since = Backoff(*RETRY_S), None
        while True:
            try:
                report()
                return
            except StoreUnavailable as error:
                _LOG.warning("%s", error)
            if stopping_since is None and self._stop.wait(backoff.delay_s()):
                stopping_since = time.monotonic()
            elif stopping_since is not None:
                if time.monotonic() > stopping_since + DRAIN_S:
                    return
                time.sleep(RETRY_S[0])
