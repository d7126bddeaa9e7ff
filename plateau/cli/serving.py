"""Commands that run the farm: whole for one scene, whole as a service, or one process of it."""

import inspect
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from plateau.cli import options as o
from plateau.cli.app import app

if TYPE_CHECKING:
    from plateau.processes.tree import Door


@app.command()
@o.takes_spec(but=o.AMONG_MANY)
def render(
    scene: o.Scene,
    spec: o.Spec,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the results.")
    ] = Path("plateau-out"),
    workers: Annotated[int, typer.Option(help="Number of worker processes.", min=1, max=256)] = 1,
    threads: Annotated[
        int | None,
        typer.Option(help="Threads of each worker.", show_default="its share of the cores", min=1),
    ] = None,
    no_curve: o.NoCurve = False,
    as_json: o.Json = False,
) -> None:
    """Render one scene on this machine until it has converged.

    For example:
      plateau render scenes:box -o out -D width=512 -D height=512
      plateau render scene.xml --rule fixed --spp 400
      plateau render scene.xml --allocation zones
      plateau render scene.xml --denoise oidn

    Starts everything it needs, and leaves nothing running. DIR then holds image.exr, image.png,
    difference.png (pixels that have changed since the first image), noise.png (pixels whose noise
    is left to see), curve.csv, curve.svg, report.html (all of it on one page), summary.txt and
    summary.json. With --allocation zones, spp.png shows which parts of the image have many samples
    (yellow) and which few (dark blue). With the rule jod, quality.png shows where a person would
    see the noise (yellow). If pixels are NaN or infinite, non-finite.png marks them; more than 0.1
    % of such pixels fail the job. The files of an earlier job in DIR are removed when the first new
    file is written. Ctrl-C cancels the job and still writes its results; a second Ctrl-C exits at
    once. If DIR cannot be written, the command fails before it renders anything. If DIR becomes
    unwritable later, the results go to a temporary folder, which the command names.
    """
    from plateau.commands.render import render as run

    code = run(
        scene, out, spec, workers=workers, threads=threads, as_json=as_json, curve=not no_curve
    )
    raise typer.Exit(code)


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


_takes_door = o.taking("door", _door, list(inspect.signature(_door).parameters.values()))


@app.command()
@_takes_door
def up(
    door: Any,
    workers: Annotated[int, typer.Option(help="Number of worker processes.", min=0, max=256)] = 1,
) -> None:
    """Run the whole service on this machine until Ctrl-C.

    For example:
      plateau up --workers 2

    Starts an API, a monitor, workers and an embedded Redis. The data folder survives a restart, and
    jobs continue. If PLATEAU_REDIS_URL or PLATEAU_BLOBS is set, that Redis or blob store is used.
    """
    from plateau.commands.serve import up as run

    raise typer.Exit(run(door, workers=workers))


@app.command()
@_takes_door
def api(door: Any, ready_fd: Annotated[int | None, typer.Option(hidden=True)] = None) -> None:
    """Run one API process.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau api
    """
    from plateau.commands.serve import api as run

    run(door, ready_fd=ready_fd)


@app.command()
def monitor() -> None:
    """Run one monitor, which merges slices, evaluates the image, and ends jobs.

    For example:
      PLATEAU_REDIS_URL=redis://10.0.0.5 PLATEAU_BLOBS=s3://farm/plateau plateau monitor

    Any number of monitors may run. When one dies, another takes over its jobs.
    """
    from plateau.commands.serve import monitor as run

    run()


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
    from plateau.commands.serve import worker as run

    run(pool=pool, tags=tag)


_days = partial(typer.Option, metavar="DAYS", min=0, max=3653)


@app.command()
def gc(
    results_older_than: Annotated[
        float | None,
        _days(
            help="Remove jobs that finished more than this many days ago, with their results.",
            show_default="PLATEAU_KEEP_RESULTS_DAYS, else never",
        ),
    ] = None,
    deleted_older_than: Annotated[
        float | None,
        _days(
            help="Remove jobs that were deleted more than this many days ago, with their results. "
            "Until then, `plateau restore` restores them.",
            show_default="PLATEAU_KEEP_DELETED_DAYS, else 7",
        ),
    ] = None,
    sums_older_than: Annotated[
        float | None,
        _days(
            help="Remove the sums of jobs that finished more than this many days ago. Without "
            "sums or kept slices, a job is rendered again from the start.",
            show_default="PLATEAU_KEEP_SUMS_DAYS, else 3",
        ),
    ] = None,
    scenes_unused_for: Annotated[
        float | None,
        _days(
            help="Remove scenes that no job has and that were not used for this many days (an "
            "hour at least).",
            show_default="PLATEAU_KEEP_RESULTS_DAYS, else never",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Remove nothing; print what would be removed.")
    ] = False,
    as_json: o.Json = False,
) -> None:
    """Remove old and deleted jobs, unused scenes and orphaned blobs.

    For example:
      plateau gc --results-older-than 30 --dry-run
      plateau gc --results-older-than 30 --scenes-unused-for 7

    Orphaned blobs, left by killed processes, are always removed. Unfinished jobs keep everything.
    Monitors do the same once an hour, by the settings PLATEAU_KEEP_RESULTS_DAYS,
    PLATEAU_KEEP_DELETED_DAYS and PLATEAU_KEEP_SUMS_DAYS.

    Works on PLATEAU_REDIS_URL and PLATEAU_BLOBS if they are set, otherwise on the data folder,
    whether `plateau up` is running or not.
    """
    from plateau.commands.gc import gc as run

    run(
        results_older_than,
        deleted_older_than,
        sums_older_than,
        scenes_unused_for,
        dry_run=dry_run,
        as_json=as_json,
    )


@app.command()
def doctor(as_json: o.Json = False) -> None:
    """Check what works on this machine, and explain what does not.

    For example:
      plateau doctor

    The exit code is 1 if nothing can be rendered.
    """
    from plateau.commands.doctor import doctor as run

    raise typer.Exit(run(as_json=as_json))
