"""`plateau up`, and its processes alone: `plateau api | monitor | worker`."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from plateau.commands.app import app
from plateau.commands.options.taking import options_of, taking
from plateau.errors import CommandFailed, tell

if TYPE_CHECKING:
    from plateau.farm.process.settings import Settings
    from plateau.farm.process.waits import Stop
    from plateau.processes.data_folder import DataFolder
    from plateau.processes.tree import Door, Tree

_TICK_S: Final = 0.2


def _door(
    *,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen on. One that other machines can reach needs an API key first."
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="Port to listen on; 0 chooses a free one.", min=0, max=65535)
    ] = 8713,
    open_to_all: Annotated[
        bool,
        typer.Option(
            "--open", help="Require no API key, even if there are some. On a loopback address only."
        ),
    ] = False,
    tls_certificate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Certificate for HTTPS: a PEM file with its chain."),
    ] = None,
    tls_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Private key of the certificate.")
    ] = None,
) -> "Door":
    from plateau.processes.tree import Door

    if (tls_certificate is None) != (tls_key is None):
        raise typer.BadParameter("give --tls-certificate and --tls-key together")
    return Door(host, port, open_to_all, tls_certificate, tls_key)


_takes_door = taking("door", _door, options_of(_door))


@app.command()
@_takes_door
def up(
    door: Any,
    workers: Annotated[
        int,
        typer.Option(
            help="Number of worker processes; on a machine with several GPUs, one for each.",
            min=0,
            max=256,
        ),
    ] = 1,
) -> None:
    """Run the whole service on this machine until Ctrl-C.

    For example:
      plateau up --workers 2

    Starts an API, a monitor, workers and an embedded Redis. The data folder survives a restart, and
    jobs continue. If PLATEAU_REDIS_URL or PLATEAU_BLOBS is set, that Redis or blob store is used.
    """
    from plateau.processes.data_folder import DataFolder
    from plateau.processes.ground import check_ground
    from plateau.processes.interrupts import Interrupts
    from plateau.processes.read_settings import farm_settings
    from plateau.processes.tree import Tree

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
            raise typer.Exit(interrupts.exit_code) from None


@app.command()
@_takes_door
def api(door: Any, ready_fd: Annotated[int | None, typer.Option(hidden=True)] = None) -> None:
    """Run one API process.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau api
    """
    import logging

    from plateau.processes.process import run_until_signal
    from plateau.processes.standing import Standing
    from plateau.service.api import process

    def serve(settings: "Settings", stop: "Stop") -> None:
        standing = Standing(settings, stop)
        if stop.is_set():
            return
        who_may = _who_may(settings.redis_url or "", door)

        def ready(url: str) -> None:
            log = logging.getLogger("plateau")
            log.info("the API listens at %s", url)
            log.info(who_may)
            if ready_fd is not None:
                with os.fdopen(ready_fd, "w", encoding="utf-8") as pipe:
                    pipe.write(f"{url}\n")
            standing.start()

        try:
            process.run(settings, ready=ready, **vars(door))
        except process.CannotListen as error:
            raise CommandFailed(str(error)) from error
        standing.end()

    run_until_signal("api", serve)


@app.command()
def monitor() -> None:
    """Run one monitor, which merges slices, evaluates the image, and ends jobs.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau monitor

    Any number of monitors may run. When one dies, another takes over its jobs.
    """
    from plateau.processes.process import run_until_signal, when_checked
    from plateau.service.monitor.monitor import run

    run_until_signal("monitor", when_checked(run))


@app.command()
def worker(
    pool: Annotated[
        str | None, typer.Option(help="Pool whose jobs it renders.", show_default="default")
    ] = None,
    tag: Annotated[
        list[str] | None, typer.Option(help="Tag that jobs may require; may be repeated.")
    ] = None,
) -> None:
    """Run one worker, which renders slices of the jobs that fit its pool, tags and variants.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau worker
      plateau worker --pool night --tag gpu --tag highmem

    PLATEAU_THREADS limits its threads. A worker may be stopped, or die, at any time.
    """
    from plateau.processes.process import run_until_signal, when_checked
    from plateau.worker.supervisor.supervisor import run

    # As variables, the options are checked with the other settings.
    given = {"PLATEAU_POOL": pool, "PLATEAU_TAGS": ",".join(tag or ())}
    os.environ.update({name: value for name, value in given.items() if value})
    run_until_signal("worker", when_checked(run))


def _greet(tree: "Tree", data: "DataFolder", door: "Door", workers: int) -> None:
    from plateau.farm.process.settings import Settings
    from plateau.farm.redis.url import without_password

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


def _who_may(redis_url: str, door: "Door") -> str:
    """A sentence that says who may use the service."""
    from plateau.farm.ledger.api_keys import ApiKeys
    from plateau.farm.model.errors import StoreUnavailable
    from plateau.farm.redis.link import connect

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


def _about_tls(door: "Door") -> str:
    from plateau.farm.redis.url import is_loopback

    if door.certificate is not None or is_loopback(door.host):
        return ""
    return (
        "API keys travel over plain HTTP, which others on the network can read: give a "
        "certificate\n"
        "(--tls-certificate, --tls-key), or put a proxy with TLS in front.\n"
    )
