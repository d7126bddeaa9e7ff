"""`plateau list`: the jobs of the service, its batches, workers and scenes."""

from datetime import datetime
from enum import Enum
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.options import complete
from plateau.commands.printing import print_table
from plateau.errors import CommandFailed, tell
from plateau.farm.model.states import JobState

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.model.worker import Worker
    from plateau.farm.wire.batch_views import BatchLineView
    from plateau.farm.wire.views import JobView, SceneView

_WAITING = 5  #: most jobs without a fitting worker that are named
_JOB = (
    *("id", "state", "spp", "noise left", "time", "to come", "created (UTC)"),
    *("by", "batch", "job"),
)
_SPARE_JOB = ("by", "created (UTC)", "batch", "time", "to come")  # on a narrow terminal
_BATCH = ("batch", "jobs", "states", "newest (UTC)")
WORKER_COLUMNS = (
    *("id", "host", "variant", "threads", "pool", "renders", "rate", "done", "load", "memory"),
    *("disk free", "°C", "core hours", "up", "version", "trouble"),
)
_SPARE_WORKER = (
    *("version", "disk free", "°C", "memory", "core hours", "up", "threads", "host", "done"),
    *("pool", "rate", "variant"),
)
_SCENE = ("sha256", "name", "size", "film")


class _What(str, Enum):
    JOBS = "jobs"
    BATCHES = "batches"
    WORKERS = "workers"
    SCENES = "scenes"


@app.command("list")
def list_of(
    what: Annotated[
        _What, typer.Argument(metavar="[WHAT]", help="jobs, batches, workers or scenes.")
    ] = _What.JOBS,
    state: Annotated[
        str | None,
        typer.Option(
            help="Only jobs in this state, such as rendering.", autocompletion=complete.states
        ),
    ] = None,
    batch: Annotated[str | None, typer.Option(help="Only jobs of this batch.")] = None,
    owner: Annotated[
        str | None, typer.Option(metavar="ID", help="Only jobs of this API key.")
    ] = None,
    search: Annotated[
        str | None,
        typer.Option(
            metavar="WORDS",
            help="Only jobs in which each word occurs: in the id, the name, the batch, the "
            "owner's name or a required tag.",
        ),
    ] = None,
    deleted: Annotated[
        bool, typer.Option("--deleted", help="Only deleted jobs, which can be restored.")
    ] = False,
    limit: Annotated[
        int, typer.Option(help="Most jobs or batches to list.", min=1, max=10_000)
    ] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List jobs or batches, newest first; or the living workers; or the stored scenes.

    For example:
      plateau list --state rendering
      plateau list --search 'kitchen dusk'
      plateau list batches
      plateau list workers
      plateau list scenes --json | jq -r '.[].sha256'

    In a pipe, columns are separated by tabs. Those of workers are: id, host, best variant, threads,
    pool and tags, job and slice, rate over the last slice, slices done, load of the machine, its
    memory in use, disk that is left for the cache, temperature of its processor in °C, what the
    worker's slices have cost since its start, time since its start, version, trouble.
    """
    if what is not _What.JOBS and (state or batch or owner or search or deleted):
        raise typer.BadParameter(
            f"--state, --batch, --owner, --search and --deleted choose jobs, not {what.value}"
        )
    in_state = _state(state)
    with connect(url) as client:
        if what is _What.BATCHES:
            _print_batches(client, limit, as_json=as_json)
        elif what is _What.WORKERS:
            _print_workers(client, as_json=as_json)
        elif what is _What.SCENES:
            _print_scenes(client, as_json=as_json)
        else:
            found = client.all_jobs(
                state=in_state,
                batch=batch,
                owner=owner,
                search=search,
                deleted=deleted,
                limit=limit,
            )
            jobs = list(found)
            print_table(jobs, _JOB, _job_row, none="no jobs", spare=_SPARE_JOB, as_json=as_json)
            if not as_json:
                _warn_of_waiting([job for job in jobs if job.waits_for])


def _state(name: str | None) -> JobState | None:
    try:
        return None if name is None else JobState(name)
    except ValueError:
        states = ", ".join(state.value for state in JobState)
        raise CommandFailed(f"there is no state {name!r}; the states are {states}") from None


def _warn_of_waiting(jobs: "list[JobView]") -> None:
    """Name on standard error the jobs that wait for others, or that no worker can render."""
    for job in jobs[:_WAITING]:
        tell(f"job {job.id} {job.waits_for}")
    if len(jobs) > _WAITING:
        tell(f"and {len(jobs) - _WAITING} others wait too")


def _job_row(job: "JobView") -> tuple[str, ...]:
    from plateau.farm.model.job import utc_now
    from plateau.farm.wire.figures import duration, percent

    left = "–" if job.estimate_fraction is None else percent(job.estimate_fraction)
    return (
        job.id,
        job.outcome,
        f"{job.spp}/{job.spec.max_spp}",
        left,
        duration(job.duration_s(utc_now())),
        job.time_left or "–",
        f"{job.created_at:%Y-%m-%d %H:%M:%S}",
        job.owner_name or "–",
        job.spec.batch or "–",
        job.title,
    )


def _print_batches(client: "Client", limit: int, *, as_json: bool) -> None:
    found = list(islice(client.all_batches(), limit))
    spare = ("newest (UTC)",)
    print_table(found, _BATCH, _batch_row, none="no batches", spare=spare, as_json=as_json)


def _batch_row(line: "BatchLineView") -> tuple[str, ...]:
    from plateau.terminal.batch_progress import in_states

    newest = f"{line.newest_at:%Y-%m-%d %H:%M:%S}"
    return (line.name, str(line.jobs), in_states(line.states), newest)


def _print_workers(client: "Client", *, as_json: bool) -> None:
    from plateau.farm.model.job import utc_now

    now = utc_now()
    print_table(
        client.workers(),
        WORKER_COLUMNS,
        lambda worker: worker_row(worker, now),
        none="there is no worker; `plateau worker` starts one, `plateau up --workers N` starts N",
        spare=_SPARE_WORKER,
        as_json=as_json,
    )


def worker_row(worker: "Worker", now: datetime) -> tuple[str, ...]:
    """The worker as a row of a table with `WORKER_COLUMNS`."""
    from plateau.farm.wire.figures import duration, percent, significant
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


def _print_scenes(client: "Client", *, as_json: bool) -> None:
    found, spare = client.scenes(), ("film", "size")
    print_table(found, _SCENE, _scene_row, none="no scene is stored", spare=spare, as_json=as_json)


def _scene_row(scene: "SceneView") -> tuple[str, ...]:
    from plateau.farm.wire.job_text import size

    film = "–" if scene.width is None or scene.height is None else f"{scene.width}×{scene.height}"
    return (scene.sha256, scene.name, size(scene.bytes), film)
