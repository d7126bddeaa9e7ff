"""`plateau render`: one scene to its results, with a process tree for it alone."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from plateau.errors import CommandFailed, tell
from plateau.exit_codes import EXIT_CODES
from plateau.farm.bundle import inspect_bundle
from plateau.farm.model.renderers import variant_for
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.out_folder import make_ready
from plateau.files.packing import pack
from plateau.processes.data_folder import DataFolder, is_in_use
from plateau.processes.interrupts import Interrupts
from plateau.processes.read_settings import read_settings
from plateau.processes.tree import Door, Tree
from plateau.worker.supervisor.variants import choose

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.wire.views import JobView
    from plateau.terminal.progress import Progress

_PREFIX: Final = "plateau-render-"
_MOST_DEATHS: Final = 3
#: Long enough for the tree to restart a dead API.
_PATIENCE_S: Final = 60.0


def render(
    scene: Path,
    out: Path,
    spec: JobSpec,
    *,
    workers: int,
    threads: int | None,
    as_json: bool,
    curve: bool = True,
) -> int:
    """Render the scene until its job has ended, and write its results; returns the exit code."""
    # Check all that can be checked before anything is started.
    with pack(scene, spec.parameter_strings()) as packed:
        found = inspect_bundle(packed.file, parameters=spec.parameter_strings(), sensor=spec.sensor)
    try:
        variant_for(spec.variant, found.renderer)
    except ValueError as error:
        raise CommandFailed(str(error)) from error
    asked = read_settings()
    _check_variant(spec.variant, asked.cache)
    make_ready(out)

    settings = asked.model_copy(
        update={
            "redis_url": None,
            "blobs": None,
            "threads": threads or asked.threads,
            # The workers are for this job alone, whatever the settings say.
            "pool": spec.pool,
            "tags": spec.requires,
        }
    )
    # The wait for the workers counts: no other job keeps them.
    spec = spec.model_copy(update={"time_limit_from": "submission"})
    with Interrupts() as interrupts, _temporary_data() as data:
        try:
            with Tree(
                settings,
                data,
                interrupts,
                workers=workers,
                door=Door(open_to_all=True),  # only this process knows its port
                tell=lambda line: shown.note(line),
                most_deaths=_MOST_DEATHS,
                is_temporary=True,
            ) as tree:
                # These imports take place while the tree's processes start.
                from rich.console import Console

                from plateau import job_text
                from plateau.client import Client
                from plateau.commands.outputs import write_or_keep
                from plateau.farm.model.job import utc_now
                from plateau.terminal.progress import progress_on

                shown = progress_on(Console(stderr=True), curve=curve)
                with Client(tree.await_api(), patience_s=_PATIENCE_S) as client:
                    job = _run(client, scene, spec, tree, interrupts, shown)
                    # The tree stops while the curve is drawn: nothing more is asked of it.
                    about = write_or_keep(client, job, out, when_fetched=tree.wind_down)
        except KeyboardInterrupt:
            return interrupts.exit_code

    if as_json:
        print(json.dumps(about, indent=2))
    else:
        print(job_text.summary(job, utc_now()))
        print(job_text.row("files", ", ".join(about["files"])))
    if job.state is JobState.FAILED:
        tell(f"the job failed: {job.reason}")
    if job.state is JobState.CANCELLED and interrupts.asked.is_set():
        return interrupts.exit_code
    return EXIT_CODES[job.state]


def _check_variant(variant: str, cache: Path) -> None:
    """Refuse a variant that the workers will lack: the job would wait for ever.

    The cache keeps the result, so the workers need not try again.
    """
    if variant == "auto":
        return
    choice = choose(cache)
    if variant in choice.variants:
        return
    tried = [one.detail for one in choice.tried if one.variant == variant]
    raise CommandFailed(
        f"this machine cannot render with {variant}"
        + (f" ({tried[0]})" if tried else "")
        + f", only with {' and '.join(choice.of_mitsuba)}: leave --variant out, or see "
        "`plateau doctor`"
    )


def _run(
    client: "Client",
    scene: Path,
    spec: JobSpec,
    tree: Tree,
    interrupts: Interrupts,
    shown: "Progress",
) -> "JobView":
    """Submit the job and follow it to its end; the first interrupt cancels it."""
    from plateau.client import ApiError
    from plateau.commands.follow import follow
    from plateau.files.plot import import_ahead

    job = client.submit(scene, spec)
    import_ahead()
    cancelled = False

    def tick() -> None:
        nonlocal cancelled
        tree.check()
        if interrupts.insisted.is_set():
            raise KeyboardInterrupt
        if interrupts.asked.is_set() and not cancelled:
            cancelled = True
            shown.note("cancelling; the results so far are written; Ctrl-C again exits at once")
            try:
                client.cancel(job.id)
            except ApiError as error:
                if error.slug != "cannot-cancel":  # it ended a moment ago
                    raise

    return follow(client, job.id, shown, tick)


@contextmanager
def _temporary_data() -> Iterator[DataFolder]:
    """A data folder that is removed at the end; removes first what killed trees have left."""
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        if not is_in_use(left):
            shutil.rmtree(left, ignore_errors=True)
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as folder,
        DataFolder(Path(folder)) as data,
    ):
        yield data
