"""`plateau up`, and its processes one by one."""

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Final

from farm import log
from farm.blobs import Blobs
from farm.errors import FarmError, SchemaMismatch, StoreUnavailable, WrongStore
from farm.pairing import check_pair
from farm.redis_link import connect
from farm.schema import await_checks, check_schema
from farm.settings import Settings
from plateau.data_folder import DataFolder
from plateau.errors import EXPECTED, CommandFailed
from plateau.exits import ExitCode
from plateau.interrupts import Interrupts
from plateau.read_settings import read_settings
from plateau.tree import Tree

_LOG = logging.getLogger("plateau")

_Run = Callable[[Settings, threading.Event], None]

_TICK_S: Final = 0.2


def up(*, workers: int, host: str, port: int) -> int:
    """Run the whole service until a signal; returns the exit code."""
    settings = read_settings()
    with Interrupts() as interrupts, DataFolder(settings.data) as data:
        try:
            with Tree(
                settings,
                data,
                interrupts,
                workers=workers,
                host=host,
                port=port,
                tell=_tell,
                most_deaths=None,
            ) as tree:
                _greet(tree, data, workers)
                while not interrupts.asked.wait(_TICK_S):
                    tree.check()
                _tell("stopping; once more to stop by force")
        except KeyboardInterrupt:
            return interrupts.exit_code
    return ExitCode.OK


def api(*, host: str, port: int, ready_fd: int | None) -> None:
    """Run an API until a signal."""
    from service import api as process

    def serve(settings: Settings, stop: threading.Event) -> None:
        late_check = _LateCheck(settings.redis_url or "", Blobs(settings.blobs or ""), stop)

        def ready(url: str) -> None:
            _LOG.info("the API listens at %s", url)
            if ready_fd is not None:
                with os.fdopen(ready_fd, "w") as pipe:
                    pipe.write(f"{url}\n")
            late_check.start()

        try:
            process.run(settings, host=host, port=port, ready=ready)
        except process.CannotListen as error:
            raise CommandFailed(str(error)) from error
        late_check.end()

    _run_until_signal("api", serve)


def monitor() -> None:
    """Run a monitor until a signal."""
    from service.monitor import run

    _run_until_signal("monitor", _with_the_schema(run))


def worker() -> None:
    """Run a worker until a signal."""
    from worker.supervisor import run

    _run_until_signal("worker", _with_the_schema(run))


def _run_until_signal(role: str, run: _Run) -> None:
    settings = read_settings()
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
    threading.excepthook = _end_with_its_thread
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    try:
        run(settings, stop)
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
    name = died.thread.name if died.thread is not None else "that is unknown"
    _LOG.critical("the thread %s died, and the process ends", name, exc_info=died.exc_value)
    logging.shutdown()
    os._exit(os.EX_SOFTWARE)


def _with_the_schema(run: _Run) -> _Run:
    """The same, once Redis answers, holds this Plateau's layout, and the blobs are its own."""

    def run_when_checked(settings: Settings, stop: threading.Event) -> None:
        with connect(settings.redis_url or "") as client:
            await_checks(client, Blobs(settings.blobs or ""), stop)
        if not stop.is_set():
            run(settings, stop)

    return run_when_checked


class _LateCheck:
    """The check of the schema for the API, which answers 503 while Redis is away, not nothing.

    Raises
    ------
    SchemaMismatch, WrongStore
        On making one, where Redis answers; else by `end`, Redis having answered since: the API
        was then asked to stop.
    """

    def __init__(self, redis_url: str, store: Blobs, stop: threading.Event) -> None:
        self._client = connect(redis_url)
        self._store = store
        self._stop = stop
        self._refusal: FarmError | None = None
        self._thread: threading.Thread | None = None
        try:
            check_schema(self._client)
            check_pair(self._client, store)
        except StoreUnavailable as error:
            _LOG.warning("%s; the API starts without it", error)
            self._thread = threading.Thread(target=self._check, daemon=True)

    def start(self) -> None:
        """Check as soon as Redis answers, unless that is done; the API can be stopped now."""
        if self._thread is not None:
            self._thread.start()

    def end(self) -> None:
        """Raise what the check found."""
        self._stop.set()
        if self._refusal is not None:
            raise self._refusal

    def _check(self) -> None:
        try:
            await_checks(self._client, self._store, self._stop)
        except (SchemaMismatch, WrongStore) as refusal:
            self._refusal = refusal
            os.kill(os.getpid(), signal.SIGTERM)


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


def _greet(tree: Tree, data: DataFolder, workers: int) -> None:
    count = {0: "no worker", 1: "1 worker"}.get(workers, f"{workers} workers")
    print(
        f"Plateau listens at {tree.url} (API: {tree.url}/docs), with {count}.\n"
        f"Data, logs: {data.path}\n"
        f"More workers on this machine:\n"
        f"  PLATEAU_REDIS_URL={tree.redis_url} PLATEAU_BLOBS={tree.blobs} plateau worker\n"
        f"Submit a scene:\n"
        f"  plateau submit scenes:box{_url_option(tree.url)}\n"
        f"Ctrl-C stops; jobs go on at the next start.",
        flush=True,
    )


def _url_option(url: str) -> str:
    return "" if url == Settings.model_fields["url"].default else f" --url {url}"


def _tell(line: str) -> None:
    print(f"plateau: {line}", file=sys.stderr, flush=True)
