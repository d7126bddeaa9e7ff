"""How a process of the farm stops: a signal asks it, and a time limit ends it."""

import logging
import os
import signal
import threading
import time
from types import FrameType
from typing import Final

from plateau.errors import ExitCode
from plateau.farm.process.waits import Stop

_LOG = logging.getLogger("plateau")

#: Time to stop after the first signal. Supervisors (systemd, Kubernetes, `plateau up`) usually
#: wait for less, and then kill the process.
LIMIT_S: Final = 60.0
#: Signals within this time count as one: a batch system may signal the process and its script.
_TOGETHER_S: Final = 1.0


class StopSignals:
    """Handles SIGTERM and SIGINT: the first one asks to stop, a later one ends the process.

    Make it in the main thread.
    """

    def __init__(self) -> None:
        self.asked = Stop()  #: set by the first signal
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
    _LOG.critical("the process did not stop within %g s, and is ended", LIMIT_S)
    logging.shutdown()
    os._exit(ExitCode.FAILED)
