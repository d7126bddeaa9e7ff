"""`plateau up`, and its processes one by one."""

import logging
import os
import sys
import threading
from typing import Final

from farm.blobs import Blobs
from farm.settings import Settings
from plateau.data_folder import DataFolder
from plateau.errors import CommandFailed
from plateau.exits import ExitCode
from plateau.interrupts import Interrupts
from plateau.process import LateCheck, run_until_signal, when_checked
from plateau.read_settings import read_settings
from plateau.tree import Tree

_LOG = logging.getLogger("plateau")

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
        late_check = LateCheck(settings.redis_url or "", Blobs(settings.blobs or ""), stop)

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

    run_until_signal("api", serve)


def monitor() -> None:
    """Run a monitor until a signal."""
    from service.monitor import run

    run_until_signal("monitor", when_checked(run))


def worker() -> None:
    """Run a worker until a signal."""
    from worker.supervisor import run

    run_until_signal("worker", when_checked(run))


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
