"""`plateau.render`: renders a scene on this machine or on a farm, and returns its image."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plateau.client.submission import spec_of
from plateau.errors import PlateauError
from plateau.farm.model.scene_roots import at_home
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.files.out_folder import ready
from plateau.files.scene_at_hand import SceneAtHand, scene_file
from plateau.processes.interrupts import Interrupts
from plateau.rendering.outputs import write_or_keep
from plateau.rendering.result import Result

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.farm.wire.views import JobView
    from plateau.terminal.progress import Progress


class RenderFailed(PlateauError):
    """The job failed; the message says why, and `result` has what is known of it."""

    def __init__(self, result: Result) -> None:
        super().__init__(f"the job failed: {result.reason}")
        self.result = result


def render(
    scene: SceneAtHand,
    spec: JobSpec | None = None,
    *,
    farm: str | None = None,
    key: str | None = None,
    out: Path | str | None = None,
    workers: int = 1,
    threads: int | None = None,
    on: str | None = None,
    progress: bool = True,
    **fields: Any,
) -> Result:
    """Render a scene until more samples make no difference that a person could see.

    Without `farm`, everything that it needs runs on this machine for as long as the call lasts:
    Redis, an API, a monitor and workers, as with the command ``plateau render``. An interrupt
    (Ctrl-C, or the stop button of a notebook) cancels the job and returns the image so far; a
    second one ends the call at once.

    Parameters
    ----------
    scene
        A Mitsuba XML, an analytic scene, or a file of another renderer; a zip or a folder of one;
        ``scenes:NAME``, an example; or a dict, as ``mitsuba.load_dict`` takes it.
        A dict may have bitmaps, tensors, volume grids, numpy and Dr.Jit arrays, transforms, meshes.
    spec
        How the scene is sampled, judged and stopped.
    farm
        URL of a service that renders it, such as ``http://127.0.0.1:8713``; None for this machine.
    key
        API key, if that service requires one; None for that of the environment (PLATEAU_KEY).
    out
        A folder for all results, the kept slices included; None for none.
    workers, threads
        Workers on this machine, and the threads of each; None shares the cores among them.
    on
        A batch system whose nodes are to have the workers, and its options:
        ``"slurm --partition=cpu --time=2:00:00"`` or ``"ray --num-gpus=1"``; None for this machine.
    progress
        Whether to show the image, the curve and the noise left in a notebook, or lines in a
        terminal, on standard error.
    **fields
        Fields of `JobSpec`, which replace those of `spec`: ``max_spp=500``, ``rule="fixed:spp=64"``
        or ``rule={"name": "fixed", "spp": 64}``, ``parameters={"width": 256}``.

    Returns
    -------
    Result
        The image, the curve, and the reason for which it ended.

    Raises
    ------
    RenderFailed
        The scene cannot be rendered, in Mitsuba's words.
    plateau.farm.bundle.BundleError
        The scene's files cannot be packed, or a value of the dict cannot be written; names it.
    plateau.InvalidSpec
        A field of the spec is unknown, or its value is not allowed.
    KeyboardInterrupt
        It was interrupted before there was an image.
    plateau.errors.PlateauError
        It could not start (`ExtraMissing` names what to install), or is refused (`ClientError`).

    Examples
    --------
    >>> import plateau
    >>> result = plateau.render("scenes:box", max_spp=500)  # doctest: +SKIP
    >>> result.image.shape, result.state.value  # doctest: +SKIP
    ((512, 512, 3), 'exhausted')
    >>> result.save("box.exr")  # doctest: +SKIP
    """
    asked = spec_of(spec, fields)
    folder = None if out is None else at_home(out)
    shown = partial(_progress, wanted=progress)
    with (
        nullcontext() if folder is None else ready(folder),
        scene_file(scene) as file,
        Interrupts(signal.SIGINT) as interrupts,
    ):
        if farm is None:
            from plateau.rendering.own_farm import checked_settings, rendered_alone

            ended = rendered_alone(
                file,
                asked,
                checked_settings(file, asked, on),
                interrupts,
                workers=workers,
                threads=threads,
                on=on,
                progress=shown,
            )
        else:
            ended = _rendered_there(file, asked, interrupts, farm, key, shown)
        with ended as (client, job):
            result = Result.fetched(client, job)
            if folder is not None:
                write_or_keep(client, job, folder)
    if result.state is JobState.FAILED:
        raise RenderFailed(result)
    return result


@contextmanager
def _rendered_there(
    file: Path,
    spec: JobSpec,
    interrupts: Interrupts,
    farm: str,
    key: str | None,
    shown: Callable[["Client"], "Progress"],
) -> Iterator[tuple["Client", "JobView"]]:
    from plateau.client import Client
    from plateau.processes.read_settings import api_key, read_settings
    from plateau.rendering.follow import cancelling, follow, worth_keeping

    with Client(farm, key=key or api_key(read_settings())) as client:
        with interrupts.ended_by(interrupts.insisted):  # at the first, the job is cancelled
            job = client.submit(file, spec)
        view = shown(client)
        job = follow(client, job.id, view, cancelling(client, job.id, interrupts, view))
        yield client, worth_keeping(job, interrupts)


def _progress(client: "Client", *, wanted: bool) -> "Progress":
    from rich.console import Console

    from plateau.rendering.notebook import NotebookProgress, in_notebook
    from plateau.terminal import progress

    if not wanted:
        return progress.Progress()
    if in_notebook():
        return NotebookProgress(client)
    return progress.progress_on(Console(stderr=True))
