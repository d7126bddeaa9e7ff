"""What every process of the farm does around its work: checks, logs, and stops on a signal."""

import gc
import logging
import os
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

from plateau.errors import EXPECTED, CommandFailed
from plateau.exit_codes import ExitCode
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.schema import await_checks
from plateau.farm.model.errors import Incompatible
from plateau.farm.process import log
from plateau.farm.process.lifecycle import forget_life, shut_memory
from plateau.farm.process.settings import Settings
from plateau.farm.process.stop import Stop
from plateau.farm.redis.link import connect
from plateau.processes.read_settings import farm_settings
from plateau.processes.shutdown import StopSignals

_LOG = logging.getLogger("plateau")

#: What a process does, given its settings and the event that tells it to stop.
Work = Callable[[Settings, Stop], None]


def run_until_signal(role: str, run: Work) -> None:
    """Run a process of this role until SIGTERM or SIGINT.

    Raises
    ------
    CommandFailed
        A setting is missing, or cannot be an address.
    SystemExit
        It could not go on; its log says why.
    """
    with suppress(OSError):
        shut_memory()
    settings = farm_settings()
    missing = [
        name
        for name, value in (
            ("PLATEAU_REDIS_URL", settings.redis_url),
            ("PLATEAU_BLOBS", settings.blobs),
        )
        if not value
    ]
    if missing:
        raise CommandFailed(
            f"set {' and '.join(missing)}: a single process joins a service that runs already "
            "(`plateau up` prints the two of its own, such as "
            "PLATEAU_REDIS_URL=redis://127.0.0.1:6379 PLATEAU_BLOBS=/srv/plateau/blobs); "
            "`plateau up` starts everything"
        )
    _check_addresses(settings.redis_url, settings.blobs)
    log.set_up(role, settings.log_format)
    forget_life(settings.alive_file)
    threading.excepthook = _end_with_its_thread
    gc.freeze()  # what was imported stays: no look for garbage need stop at it
    stop = StopSignals().asked
    try:
        run(settings, stop)
    except Incompatible as error:
        _LOG.critical("%s", error)
        sys.exit(ExitCode.INCOMPATIBLE)
    except EXPECTED as error:
        _LOG.critical("%s", error)
        sys.exit(ExitCode.FAILED)
    except Exception:  # noqa: BLE001  (the log has it, and the exit code says so)
        _LOG.critical("an error that Plateau did not expect ends the process", exc_info=True)
        sys.exit(os.EX_SOFTWARE)


def _end_with_its_thread(died: threading.ExceptHookArgs) -> None:
    """End the process in which a thread died of an exception, as if it had been killed.

    It would look alive without one that renews its leases or commits its slices; whoever started
    it can start it again, and others take over its work.
    """
    if died.exc_type is SystemExit:
        return
    if isinstance(died.exc_value, Incompatible):
        _LOG.critical("%s", died.exc_value)
        logging.shutdown()
        os._exit(ExitCode.INCOMPATIBLE)
    name = died.thread.name if died.thread is not None else "that is unknown"
    _LOG.critical("the thread %s died, and the process ends", name, exc_info=died.exc_value)
    logging.shutdown()
    os._exit(os.EX_SOFTWARE)


def when_checked(run: Work) -> Work:
    """The same, once Redis answers, holds this Plateau's layout, and the blobs are its own."""

    def run_when_checked(settings: Settings, stop: Stop) -> None:
        patient = settings.when_refused == "wait"
        with connect(settings.redis_url or "") as client:
            await_checks(client, Blobs(settings.blobs or ""), stop, patient=patient)
        if not stop.is_set():
            run(settings, stop)

    return run_when_checked


def _check_addresses(redis_url: str | None, blobs: str | None) -> None:
    """Refuse what cannot be an address; whether anything answers there shows later."""
    for name, value, opens in (
        ("PLATEAU_REDIS_URL", redis_url, connect),
        ("PLATEAU_BLOBS", blobs, Blobs),
    ):
        try:
            opens(value or "")
        except Exception as error:
            reason = str(error).partition("\n")[0]  # obstore adds a dump of its insides
            raise CommandFailed(f"{name}: {reason}") from error
