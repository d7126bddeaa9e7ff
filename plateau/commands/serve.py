"""`plateau up`, and its processes one by one."""

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Final

from farm.blobs import Blobs
from farm.redis_link import connect
from farm.settings import Settings
from plateau.data_folder import DataFolder
from plateau.errors import CommandFailed
from plateau.exits import ExitCode
from plateau.interrupts import Interrupts
from plateau.read_settings import read_settings
from plateau.tree import Tree

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

    def ready(url: str) -> None:
        logging.getLogger("plateau").info("the API listens at %s", url)
        if ready_fd is not None:
            with os.fdopen(ready_fd, "w") as pipe:
                pipe.write(f"{url}\n")

    def serve(settings: Settings, _: threading.Event) -> None:
        try:
            process.run(settings, host=host, port=port, ready=ready)
        except process.CannotListen as error:
            raise CommandFailed(str(error)) from error

    _run_until_signal(serve)


def monitor() -> None:
    """Run a monitor until a signal."""
    from service.monitor import run

    _run_until_signal(run)


def worker() -> None:
    """Run a worker until a signal."""
    from worker.supervisor import run

    _run_until_signal(run)


def _run_until_signal(run: Callable[[Settings, threading.Event], None]) -> None:
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
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
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    run(settings, stop)


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
