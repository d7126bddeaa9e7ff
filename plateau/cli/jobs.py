"""Commands that talk to a running service."""

from pathlib import Path
from typing import Annotated

import typer

from plateau.cli import complete
from plateau.cli import options as o
from plateau.cli.app import app


@app.command()
@o.takes_spec()
def submit(
    scene: o.Scene,
    spec: o.Spec,
    each: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUES",
            help="Submit one job for each value of the scene's parameter $NAME: 0..99 or 0..99:2 "
            "(whole numbers, the last one included), a,b,c, or a list of ranges; repeated, for "
            "each combination.",
        ),
    ] = None,
    zipped: Annotated[
        bool,
        typer.Option(
            "--zipped",
            help="Combine the values of several --each one by one: the first with the first.",
        ),
    ] = False,
    parameters: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Submit one job for each row of a CSV file with a header, or for each object of a "
            "JSON list.",
        ),
    ] = None,
    same_seeds: Annotated[
        bool,
        typer.Option(
            "--same-seeds",
            help="With --each or --parameters: draw the same samples in all frames. Their noise "
            "then stands still, and is seen more. By default each has a seed of its own.",
        ),
    ] = False,
    notify: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHO",
            help="Who is notified when the job ends: a target that the farm's operator has named, "
            "or a URL, which gets a POST signed with PLATEAU_WEBHOOK_SECRET; may be repeated.",
        ),
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Submit a scene to a running service, and print the id of the job or the name of the batch.

    For example:
      plateau submit scenes:box --max-spp 2000 --batch tuesday
      plateau watch $(plateau submit scene.zip -D width=512) -o out
      plateau submit '{assets}/shots/walk/scene.xml' --max-spp 4000
      plateau submit walk.zip --each frame=0..99 --batch walk --min-spp 400
      plateau watch --batch walk -o frames
      plateau submit scene.zip --notify ops --notify https://studio.example/hooks/plateau
    """
    from plateau.commands.batches import submit as submit_batch
    from plateau.commands.jobs import submit as run
    from plateau.commands.jobs import with_notice

    spec = with_notice(spec, notify or ())
    if zipped and not each:
        raise typer.BadParameter("--zipped combines the values of --each: give some")
    if parameters is None and not each:
        if same_seeds:
            raise typer.BadParameter("--same-seeds is of many jobs: give --each or --parameters")
        run(scene, spec, url=url, as_json=as_json)
    else:
        submit_batch(
            scene,
            spec,
            parameters=parameters,
            definitions=each or [],
            zipped=zipped,
            same_seeds=same_seeds,
            url=url,
            as_json=as_json,
        )


@app.command()
def watch(
    job_id: o.OrJobId = None,
    batch: o.OrBatch = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Folder for the results; of a batch, also a pattern for its images alone.",
        ),
    ] = None,
    no_curve: o.NoCurve = False,
    events: Annotated[
        bool, typer.Option("--events", help="Print each event as a line of JSON, and nothing else.")
    ] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Watch a job or a batch until it ends; the exit code says how it ended.

    For example:
      plateau watch 3f9ac2d01b77 -o out
      plateau watch --batch walk -o frames
      plateau watch --batch walk -o 'shots/{batch}.{frame:04d}.exr'
      plateau watch 3f9ac2d01b77 --events | jq 'select(.type == "point") | .data.visible_pixels'

    On a terminal the curve is drawn as it grows. Ctrl-C stops watching; the job continues. --json
    prints the summary at the end. A pattern's fields are batch, name, id, place, and the
    parameters of the scene. The exit code is 3 if jobs of the batch ended before their rule
    stopped them.
    """
    from plateau.commands.batches import watch as watch_batch
    from plateau.commands.jobs import stream
    from plateau.commands.jobs import watch as run

    if events and (out is not None or as_json):
        raise typer.BadParameter("--events cannot be combined with --out or --json")
    if events and batch is not None:
        raise typer.BadParameter("--events shows one job, not a batch")
    job = o.one_of(job_id, batch)
    if batch is not None:
        raise typer.Exit(watch_batch(batch, out, url=url, as_json=as_json))
    if events:
        raise typer.Exit(stream(job, url=url))
    raise typer.Exit(run(job, out, url=url, as_json=as_json, curve=not no_curve))


@app.command()
def show(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Show a job: its state and the reason, its history, and the URLs of its images.

    For example:
      plateau show 3f9ac2d01b77
    """
    from plateau.commands.jobs import show as run

    run(job_id, url=url, as_json=as_json)


@app.command()
def log(
    job_id: o.JobId,
    index: Annotated[
        int | None, typer.Option("--slice", metavar="N", help="Only this slice.", min=0)
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show how each try of a slice ended, and what Mitsuba printed.

    For example:
      plateau log 3f9ac2d01b77 --slice 4
    """
    from plateau.commands.jobs import log as run

    run(job_id, index=index, url=url, as_json=as_json)


@app.command("list")
def list_jobs(
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
    limit: Annotated[int, typer.Option(help="Most jobs to list.", min=1, max=10_000)] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List jobs, newest first.

    For example:
      plateau list --state rendering
      plateau list --search 'kitchen dusk'
    """
    from plateau.commands.jobs import list_jobs as run

    run(
        state=state,
        batch=batch,
        owner=owner,
        search=search,
        deleted=deleted,
        limit=limit,
        url=url,
        as_json=as_json,
    )
