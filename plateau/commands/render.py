"""`plateau render`: one scene to its results, with a process tree for it alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.options.spec_options import AMONG_MANY, Spec, takes_spec
from plateau.commands.printing import print_json
from plateau.errors import EXIT_CODES, tell
from plateau.farm.model.states import JobState

if TYPE_CHECKING:
    from plateau.client import Client
    from plateau.terminal.progress import Progress


@app.command()
@takes_spec(but=AMONG_MANY)
def render(
    scene: o.Scene,
    spec: Spec,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")
    ] = Path("plateau-out"),
    workers: Annotated[
        int,
        typer.Option(
            help="Number of worker processes; on a machine with several GPUs, one for each.",
            min=1,
            max=256,
        ),
    ] = 1,
    threads: o.Threads = None,
    on: o.On = None,
    no_curve: o.NoCurve = False,
    as_json: o.Json = False,
) -> None:
    """Render one scene until it has converged, on this machine or on nodes of a cluster.

    For example:
      plateau render scenes:box -o out -D width=512 -D height=512
      plateau render scene.xml --rule fixed --spp 400
      plateau render scene.xml --allocation zones
      plateau render scene.xml --denoise oidn
      plateau render scene.xml --workers 8 --on "slurm --partition=cpu --time=2:00:00"

    Starts everything it needs, and leaves nothing running. DIR then holds image.exr, image.png,
    difference.png (pixels that have changed since the first image), noise.png (pixels whose noise
    is left to see), curve.csv, curve.svg, summary.txt and summary.json. With --allocation zones,
    spp.png shows which parts of the image have many samples (yellow) and which few (dark blue).
    With the rule jod, quality.png shows where a person would see the noise (yellow). If pixels are
    NaN or infinite, non-finite.png marks them; more than 0.1 % of such pixels fail the job. The
    files of an earlier job in DIR are replaced at the end, all together, and no other command can
    write there meanwhile. Ctrl-C cancels the job and writes its results so far; a second Ctrl-C
    exits at once. If DIR cannot be written, the command fails before it renders anything. If DIR
    becomes unwritable later, the results go to a temporary folder, which the command names.
    """
    from plateau.files.out_folder import ready
    from plateau.processes.interrupts import Interrupts
    from plateau.rendering.own_farm import checked_settings, rendered_alone

    settings = checked_settings(scene, spec, on)

    def progress(_: "Client") -> "Progress":
        from rich.console import Console

        from plateau.terminal.progress import progress_on

        return progress_on(Console(stderr=True), curve=not no_curve)

    with ready(out), Interrupts() as interrupts:
        try:
            with rendered_alone(
                scene,
                spec,
                settings,
                interrupts,
                workers=workers,
                threads=threads,
                on=on,
                progress=progress,
            ) as (client, job):
                from plateau.rendering.outputs import write_or_keep

                about = write_or_keep(client, job, out)
        except KeyboardInterrupt:
            raise typer.Exit(interrupts.exit_code) from None

    if as_json:
        print_json(about)
    else:
        from plateau.farm.model.job import utc_now
        from plateau.farm.wire import job_text

        print(job_text.summary(job, utc_now()))
        print(job_text.row("files", ", ".join(about["files"])))
    if job.state is JobState.FAILED:
        tell(f"the job failed: {job.reason}")
    if job.state is JobState.CANCELLED and interrupts.asked.is_set():
        raise typer.Exit(interrupts.exit_code)
    raise typer.Exit(EXIT_CODES[job.state])
