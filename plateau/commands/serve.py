"""`plateau up`, and its processes alone: `plateau api | monitor | worker`."""

import logging
import os
import threading
from typing import Final

from plateau.errors import CommandFailed, tell
from plateau.exit_codes import ExitCode
from plateau.farm.ledger.api_keys import ApiKeys
from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.addresses import is_loopback
from plateau.farm.process.settings import Settings
from plateau.farm.redis.link import connect
from plateau.farm.redis.url import without_password
from plateau.processes.data_folder import DataFolder
from plateau.processes.ground import check_ground
from plateau.processes.interrupts import Interrupts
from plateau.processes.process import run_until_signal, when_checked
from plateau.processes.read_settings import farm_settings
from plateau.processes.standing import Standing
from plateau.processes.tree import Door, Tree

_LOG = logging.getLogger("plateau")

_TICK_S: Final = 0.2


def up(door: Door, *, workers: int) -> int:
    """Run the whole service until a signal; returns the exit code."""
    settings = farm_settings()
    alone = settings.redis_url is None
    check_ground(settings, caches=workers > 0, has_redis=alone, data=settings.data)
    with DataFolder(settings.data) as data, Interrupts() as interrupts:
        try:
            with Tree(
                settings, data, interrupts, workers=workers, door=door, tell=tell, most_deaths=None
            ) as tree:
                tree.await_api()
                _greet(tree, data, door, workers)
                while not interrupts.asked.wait(_TICK_S):
                    tree.check()
                tell("stopping; Ctrl-C again stops by force")
        except KeyboardInterrupt:
            return interrupts.exit_code
    return ExitCode.OK


def api(door: Door, *, ready_fd: int | None) -> None:
    """Run an API until a signal."""
    from plateau.service.api import process

    tls = None
    if door.certificate is not None and door.private_key is not None:
        tls = process.Tls(door.certificate, door.private_key)

    def serve(settings: Settings, stop: threading.Event) -> None:
        standing = Standing(settings, stop)
        if stop.is_set():
            return
        who_may = _who_may(settings.redis_url or "", door)

        def ready(url: str) -> None:
            _LOG.info("the API listens at %s", url)
            _LOG.info(who_may)
            if ready_fd is not None:
                with os.fdopen(ready_fd, "w", encoding="utf-8") as pipe:
                    pipe.write(f"{url}\n")
            standing.start()

        try:
            process.run(
                settings,
                host=door.host,
                port=door.port,
                open_to_all=door.open_to_all,
                tls=tls,
                ready=ready,
            )
        except process.CannotListen as error:
            raise CommandFailed(str(error)) from error
        standing.end()

    run_until_signal("api", serve)


def monitor() -> None:
    """Run a monitor until a signal."""
    from plateau.service.monitor.monitor import run

    run_until_signal("monitor", when_checked(run))


def worker(*, pool: str | None, tags: list[str] | None) -> None:
    """Run a worker until a signal, in this pool and with these tags if they are given."""
    from plateau.worker.supervisor.supervisor import run

    # As variables, the options are checked with the other settings.
    given = {"PLATEAU_POOL": pool, "PLATEAU_TAGS": ",".join(tags or ())}
    os.environ.update({name: value for name, value in given.items() if value})
    run_until_signal("worker", when_checked(run))


def _greet(tree: Tree, data: DataFolder, door: Door, workers: int) -> None:
    count = {0: "no worker", 1: "1 worker"}.get(workers, f"{workers} workers")
    option = "" if tree.url == Settings.model_fields["url"].default else f" --url {tree.url}"
    print(
        f"Plateau listens at {tree.url} (API: {tree.url}/docs), with {count}.\n"
        f"{_who_may(tree.redis_url, door)}\n{_about_tls(door)}"
        f"Data, logs: {data.path}\n"
        f"More workers on this machine:\n"
        f"  PLATEAU_REDIS_URL={without_password(tree.redis_url)} PLATEAU_BLOBS={tree.blobs} "
        f"plateau worker\n"
        f"Submit a scene:\n"
        f"  plateau submit scenes:box{option}\n"
        f"Ctrl-C stops the service; jobs continue at the next start.",
        flush=True,
    )


def _who_may(redis_url: str, door: Door) -> str:
    """A sentence that says who may use the service."""
    if door.open_to_all:
        return "It is open to everybody on this machine, as --open asks."
    try:
        with connect(redis_url) as client:
            keys = ApiKeys(client).all()
    except StoreUnavailable:
        return "Redis does not answer yet, so it is unknown who may use the service."
    if not keys:
        return (
            "It is open to everybody on this machine, and to nobody else: there is no API key yet "
            "(`plateau keys create NAME`)."
        )
    usable = sum(key.usable for key in keys)
    count = {0: "all were revoked", 1: "there is 1"}.get(usable, f"there are {usable}")
    return f"Every request needs an API key ({count}); commands take it from PLATEAU_KEY."


def _about_tls(door: Door) -> str:
    if door.certificate is not None or is_loopback(door.host):
        return ""
    return (
        "API keys travel over plain HTTP, which others on the network can read: give a "
        "certificate\n"
        "(--tls-certificate, --tls-key), or put a proxy with TLS in front.\n"
    )
