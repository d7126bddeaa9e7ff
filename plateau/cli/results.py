"""Commands that fetch a job's results, and list workers and scenes."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import options as o
from plateau.cli.app import app
from plateau.farm.model.usage import Grouping


@app.command()
def curve(
    job_id: o.JobId,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Print the curve of a job, one line for each point; on a terminal, also draw it.

    For example:
      plateau curve 3f9ac2d01b77
      plateau curve 3f9ac2d01b77 --csv > curve.csv
    """
    if as_csv and as_json:
        raise typer.BadParameter("--csv and --json are two forms: choose one")
    from plateau.commands.fetch import curve as run

    run(job_id, url=url, as_csv=as_csv, as_json=as_json)


@app.command()
def fetch(
    job_id: o.JobId,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for the files.")
    ] = Path("plateau-out"),
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Fetch the images, the curve and a summary of a job, running or ended.

    For example:
      plateau fetch 3f9ac2d01b77 -o out

    Writes what `plateau render` does, report.html among it, and prints the names of the files. Kept
    slices are fetched too, except those already in DIR. Files of another job in DIR are removed;
    other files are not. --json prints the summary. Over HTTP, GET /v1/jobs/ID/results.zip has all
    but slices in one file.
    """
    from plateau.commands.fetch import fetch as run

    run(job_id, out, url=url, as_json=as_json)


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
    from plateau.commands.farm import workers as run

    run(url=url, as_json=as_json)


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
    from plateau.commands.farm import drain as run

    run(worker_id, undo=undo, url=url, as_json=as_json)


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
    from plateau.commands.usage import usage as run

    run(by, since=since, until=until, url=url, as_csv=as_csv, as_json=as_json)


@app.command()
def scenes(url: o.Url = None, as_json: o.Json = False) -> None:
    """List the stored scenes.

    For example:
      plateau scenes
      plateau scenes --json | jq -r '.[].sha256'
    """
    from plateau.commands.farm import scenes as run

    run(url=url, as_json=as_json)
