"""How a process of the farm is stopped: asked by a signal, and ended where it does not stop."""

import logging
import os
import signal
import threading
import time
from types import FrameType
from typing import Final

from plateau.exit_codes import ExitCode
from plateau.farm.process.stop import Stop

_LOG = logging.getLogger("plateau")

#: A process that was asked to stop has so long. Whoever stops it (systemd, Kubernetes, a tree of
#: `plateau up`) usually waits for less than that, and then kills it.
LIMIT_S: Final = 60.0
#: Signals that come together are one: a batch system may send its own and have a script pass it on.
_TOGETHER_S: Final = 1.0


class StopSignals:
    """SIGTERM and SIGINT from now on: the first asks, one that comes later ends the process.

    To be made in the main thread.

    Attributes
    ----------
    asked
        Set by the first signal.
    """

    def __init__(self) -> None:
        self.asked = Stop()
        self._asked_at = 0.0
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._heard)

    def _heard(self, number: int, _: FrameType | None) -> None:
        now = time.monotonic()
        if not self.asked.is_set():
            self.asked.set()
            self._asked_at = now
            limit = threading.Timer(LIMIT_S, _give_up)
            limit.daemon = True
            limit.start()
        elif now > self._asked_at + _TOGETHER_S:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)


def _give_up() -> None:
    _LOG.critical("it was asked to stop and did not within %g s: it is ended", LIMIT_S)
    logging.shutdown()
    os._exit(ExitCode.FAILED)
