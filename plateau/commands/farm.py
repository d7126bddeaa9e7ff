"""`plateau workers | scenes`: the farm's workers and stored scenes."""

import json
from datetime import datetime

from plateau.commands.connect import connect
from plateau.farm.model.job import utc_now
from plateau.farm.model.worker import Worker
from plateau.farm.wire.figures import duration, percent, significant
from plateau.farm.wire.job_text import share_of, size
from plateau.farm.wire.views import SceneView
from plateau.terminal.tables import print_rows

WORKER_COLUMNS = (
    "id",
    "host",
    "variant",
    "threads",
    "pool",
    "renders",
    "rate",
    "done",
    "load",
    "memory",
    "disk free",
    "°C",
    "core hours",
    "up",
    "version",
    "trouble",
)
_SPARE = (
    "version",
    "disk free",
    "°C",
    "memory",
    "core hours",
    "up",
    "threads",
    "host",
    "done",
    "pool",
    "rate",
    "variant",
)


def workers(*, url: str | None, as_json: bool) -> None:
    """Print the living workers."""
    with connect(url) as client:
        found = client.workers()
    if as_json:
        print(json.dumps([worker.model_dump(mode="json") for worker in found], indent=2))
    else:
        now = utc_now()
        print_rows(
            WORKER_COLUMNS,
            [worker_row(worker, now) for worker in found],
            none="there is no worker; `plateau worker` starts one, `plateau up --workers N` "
            "starts N",
            spare=_SPARE,
        )


def drain(worker_id: str, *, undo: bool, url: str | None, as_json: bool) -> None:
    """Drain a worker, or let it take slices again."""
    with connect(url) as client:
        worker = client.undrain(worker_id) if undo else client.drain(worker_id)
    state = "drained" if worker.drained else "takes slices"
    print(worker.model_dump_json(indent=2) if as_json else f"{worker.id} {state}")


def scenes(*, url: str | None, as_json: bool) -> None:
    """Print the stored scenes."""
    with connect(url) as client:
        found = client.scenes()
    if as_json:
        print(json.dumps([scene.model_dump(mode="json") for scene in found], indent=2))
    else:
        columns, rows = ("sha256", "name", "size", "film"), list(map(_scene_row, found))
        print_rows(columns, rows, none="no scene is stored", spare=("film", "size"))


def worker_row(worker: Worker, now: datetime) -> tuple[str, ...]:
    """The worker as a row of a table with `WORKER_COLUMNS`."""
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


def _scene_row(scene: SceneView) -> tuple[str, ...]:
    film = "–" if scene.width is None or scene.height is None else f"{scene.width}×{scene.height}"
    return (scene.sha256, scene.name, size(scene.bytes), film)
