"""What every process of the farm does around its work: checks, logs, stops on a signal."""

import gc
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Final

from plateau.errors import EXPECTED, CommandFailed, ExitCode
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.schema import await_checks
from plateau.farm.model.errors import Incompatible
from plateau.farm.process import log
from plateau.farm.process.lifecycle import forget_life, shut_memory
from plateau.farm.process.scratch import remove_left
from plateau.farm.process.settings import Settings
from plateau.farm.process.waits import Stop
from plateau.farm.redis.link import connect
from plateau.processes.ground import check_ground
from plateau.processes.read_settings import farm_settings

_LOG = logging.getLogger("plateau")

#: Time to stop after the first signal. Supervisors (systemd, Kubernetes, `plateau up`) usually
#: wait for less, and then kill the process.
LIMIT_S: Final = 60.0
#: Signals within this time count as one: a batch system may signal the process and its script.
_TOGETHER_S: Final = 1.0

#: The work of a process, given its settings and the event that tells it to stop.
Work = Callable[[Settings, Stop], None]


def run_until_signal(role: str, run: Work) -> None:
    """Run a process of this role until SIGTERM or SIGINT.

    Raises `CommandFailed` for a wrong setting, and `SystemExit` after an error, which is logged.
    """
    with suppress(OSError):
        shut_memory()
    settings = farm_settings()
    check_ground(settings, caches=role == "worker")
    _check_addresses(settings)
    log.set_up(role, settings.log_format)
    forget_life(settings.alive_file)
    remove_left()
    threading.excepthook = _end_with_its_thread
    gc.freeze()  # imported modules stay: the garbage collector can skip them
    stop = StopSignals().asked
    try:
        run(settings, stop)
    except EXPECTED as error:
        _LOG.critical("%s", error)
        sys.exit(ExitCode.INCOMPATIBLE if isinstance(error, Incompatible) else ExitCode.FAILED)
    except Exception:  # noqa: BLE001  (it is logged, and the exit code shows it)
        _LOG.critical("an unexpected error ends the process", exc_info=True)
        sys.exit(os.EX_SOFTWARE)


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
            self._asked_at = now  # first: the next signal may come at any moment
            self.asked.set()
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


def _end_with_its_thread(died: threading.ExceptHookArgs) -> None:
    """End the process at once when an exception has ended one of its threads.

    It would seem alive without a thread that renews its leases or commits its slices. When it has
    ended, it can be restarted, and others take over its work.
    """
    if died.exc_type is SystemExit:
        return
    if isinstance(died.exc_value, Incompatible):
        _LOG.critical("%s", died.exc_value)
        code: int = ExitCode.INCOMPATIBLE
    else:
        name = died.thread.name if died.thread is not None else "without a name"
        _LOG.critical("the thread %s died, and the process ends", name, exc_info=died.exc_value)
        code = os.EX_SOFTWARE
    logging.shutdown()
    os._exit(code)


def when_checked(run: Work) -> Work:
    """The work, after Redis answers, its layout fits this version, and the blobs belong to it."""

    def run_when_checked(settings: Settings, stop: Stop) -> None:
        with connect(settings.redis_url or "") as client:
            await_checks(client, Blobs(settings.blobs or ""), stop)
        if not stop.is_set():
            run(settings, stop)

    return run_when_checked


def _check_addresses(settings: Settings) -> None:
    """Require valid addresses of Redis and of the blobs; nothing connects yet."""
    addresses: dict[str, tuple[str | None, Callable[[str], object]]] = {
        "PLATEAU_REDIS_URL": (settings.redis_url, connect),
        "PLATEAU_BLOBS": (settings.blobs, Blobs),
    }
    missing = [name for name, (value, _) in addresses.items() if not value]
    if missing:
        raise CommandFailed(
            f"set {' and '.join(missing)}: a single process joins a running service (`plateau up` "
            "prints the two variables of its own, such as "
            "PLATEAU_REDIS_URL=redis://127.0.0.1:6379 PLATEAU_BLOBS=/srv/plateau/blobs); "
            "`plateau up` starts everything"
        )
    for name, (value, opens) in addresses.items():
        try:
            opens(value or "")
        except Exception as error:
            reason = str(error).partition("\n")[0]  # obstore adds debug output
            raise CommandFailed(f"{name}: {reason}") from error
