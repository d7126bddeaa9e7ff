"""`plateau workers | drain | usage | scenes`: what a farm has, and what it has cost."""

from datetime import datetime
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_one, print_table
from plateau.errors import tell
from plateau.farm.model.usage import Grouping
from plateau.farm.wire.figures import duration, percent, significant

if TYPE_CHECKING:
    from plateau.farm.model.worker import Worker
    from plateau.farm.wire.usage_views import UsageRow
    from plateau.farm.wire.views import SceneView

WORKER_COLUMNS = (
    *("id", "host", "variant", "threads", "pool", "renders", "rate", "done", "load", "memory"),
    *("disk free", "°C", "core hours", "up", "version", "trouble"),
)
_SPARE_OF_WORKERS = (
    *("version", "disk free", "°C", "memory", "core hours", "up", "threads", "host", "done"),
    *("pool", "rate", "variant"),
)


@app.command()
def workers(url: o.Url = None, as_json: o.Json = False) -> None:
    """List the living workers, and what each renders.

    For example:
      plateau workers

    In a pipe, columns are separated by tabs: id, host, best variant, threads, pool and tags, job
    and slice, rate over the last slice, slices done, load of the machine, its memory in use, disk
    that is left for the cache, temperature of its processor in °C, what the worker's slices have
    cost since its start, its share of what its jobs saved, time since its start, version, trouble.
    """
    from plateau.farm.model.job import utc_now

    with connect(url) as client:
        found = client.workers()
    now = utc_now()
    print_table(
        found,
        WORKER_COLUMNS,
        lambda worker: worker_row(worker, now),
        none="there is no worker; `plateau worker` starts one, `plateau up --workers N` starts N",
        spare=_SPARE_OF_WORKERS,
        as_json=as_json,
    )


def worker_row(worker: "Worker", now: datetime) -> tuple[str, ...]:
    """The worker as a row of a table with `WORKER_COLUMNS`."""
    from plateau.farm.wire.job_text import share_of, size

    rate, machine = worker.samples_per_s, worker.machine
    free = None if machine is None else machine.disk_free_bytes
    temperature = None if machine is None else machine.temperature_c
    return (
        worker.id,
        worker.host,
        worker.variants[0] if worker.variants else "–",
        str(worker.threads),
        ", ".join((worker.pool, *worker.tags)),
        "–" if worker.job is None else f"{worker.job}/{worker.slice}",
        "–" if rate is None else f"{rate / 1e6:.2f} Msamples/s",
        str(worker.slices_done),
        "–" if machine is None else percent(machine.load),
        "–" if machine is None else share_of(machine.memory_used_bytes, machine.memory_bytes),
        "–" if free is None else size(free),
        "–" if temperature is None else f"{temperature:.0f}",
        "–" if worker.core_hours is None else significant(worker.core_hours),
        duration(max(0.0, (now - worker.started_at).total_seconds())),
        worker.plateau or "–",
        worker.trouble or worker.last_error or "–",
    )


@app.command()
def drain(
    worker_id: Annotated[
        str, typer.Argument(metavar="WORKER", help="The worker's id, as `plateau workers` has it.")
    ],
    undo: Annotated[bool, typer.Option("--undo", help="Let it take slices again.")] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Let a worker finish its slice and take no more, so that it can be stopped without loss.

    For example:
      plateau drain vm-23618-bc86
      plateau drain vm-23618-bc86 --undo

    It lasts as long as that process lives. If the service has keys, it needs an admin's.
    """
    with connect(url) as client:
        worker = client.undrain(worker_id) if undo else client.drain(worker_id)
    state = "drained" if worker.drained else "takes slices"
    print_one(worker, f"{worker.id} {state}", as_json=as_json)


@app.command()
def usage(
    by: Annotated[Grouping, typer.Option(help="What a row is.")] = "week",
    since: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Jobs submitted from this day, or time (UTC), on."),
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help="And before this day or time.")
    ] = None,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Sum up what the stored jobs have cost, in core hours.

    For example:
      plateau usage
      plateau usage --by owner --since 2026-11-01 --csv > november.csv

    In a pipe, columns are separated by tabs: week, owner, batch or job, name, jobs, core hours,
    core hours saved. The total goes to standard error. Removed jobs do not count any more.
    """
    if as_csv and as_json:
        raise typer.BadParameter("--csv and --json are two forms: choose one")
    with connect(url) as client:
        if as_csv:
            print(client.usage_csv(by, since=since, until=until), end="")
            return
        found = client.usage(by, since=since, until=until)
    if as_json:
        print(found.model_dump_json(indent=2))
        return
    columns = (by, "name", "jobs", "core hours", "saved")
    none = "there is no job of that time"
    print_table(found.rows, columns, _usage_row, none=none, spare=("saved", "name", "jobs"))
    if found.rows:
        total = found.total
        of = "1 job" if total.jobs == 1 else f"{total.jobs:,} jobs"
        tell(f"{of}: {significant(total.core_hours)} core hours")


def _usage_row(row: "UsageRow") -> tuple[str, ...]:
    return (
        row.key or "–",
        row.name or "–",
        f"{row.jobs:,}",
        significant(row.core_hours),
        significant(row.saved_core_hours),
    )


@app.command()
def scenes(url: o.Url = None, as_json: o.Json = False) -> None:
    """List the stored scenes.

    For example:
      plateau scenes
      plateau scenes --json | jq -r '.[].sha256'
    """
    with connect(url) as client:
        found = client.scenes()
    columns, spare = ("sha256", "name", "size", "film"), ("film", "size")
    print_table(found, columns, _scene_row, none="no scene is stored", spare=spare, as_json=as_json)


def _scene_row(scene: "SceneView") -> tuple[str, ...]:
    from plateau.farm.wire.job_text import size

    film = "–" if scene.width is None or scene.height is None else f"{scene.width}×{scene.height}"
    return (scene.sha256, scene.name, size(scene.bytes), film)
