"""Commands that talk to a running service."""

from pathlib import Path
from typing import Annotated

import typer

from plateau import options as o
from plateau.cli.app import command, plain_errors


@command()
@o.takes_spec
def submit(
    scene: o.Scene,
    spec: o.Spec,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Submit a scene to a running service; prints the new job's id.

    For example:
      plateau submit scenes:box --max-spp 2000 --batch tuesday
      plateau watch $(plateau submit scene.zip -D width=512) -o out
    """
    from plateau.commands.jobs import submit as run

    with plain_errors():
        run(scene, spec, url=url, as_json=as_json)


@command()
def watch(
    job_id: o.JobId,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Write the results there.")
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Watch a job until it is finished; the exit code says how it ended.

    For example:
      plateau watch 3f9ac2d01b77 -o out

    Ctrl-C stops watching; the job goes on.
    """
    from plateau.commands.jobs import watch as run

    with plain_errors():
        raise typer.Exit(run(job_id, out, url=url, as_json=as_json))


@command()
def show(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Show a job: where it stands and why, its story, and where its images are.

    For example:
      plateau show 3f9ac2d01b77
    """
    from plateau.commands.jobs import show as run

    with plain_errors():
        run(job_id, url=url, as_json=as_json)


@command()
def log(
    job_id: o.JobId,
    index: Annotated[
        int | None, typer.Option("--slice", metavar="N", help="Only this slice.", min=0)
    ] = None,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Show how each try of a slice ended, and what Mitsuba printed meanwhile.

    For example:
      plateau log 3f9ac2d01b77 --slice 4
    """
    from plateau.commands.jobs import log as run

    with plain_errors():
        run(job_id, index=index, url=url, as_json=as_json)


@command("list")
def list_jobs(
    state: Annotated[
        str | None, typer.Option(help="Only jobs in this state, such as rendering.")
    ] = None,
    batch: Annotated[str | None, typer.Option(help="Only jobs of this batch.")] = None,
    limit: Annotated[int, typer.Option(help="Most jobs to list.", min=1, max=10_000)] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List jobs, newest first.

    For example:
      plateau list --state rendering
    """
    from plateau.commands.jobs import list_jobs as run

    with plain_errors():
        run(state=state, batch=batch, limit=limit, url=url, as_json=as_json)


@command()
def cancel(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Cancel a job; what is merged by then is kept as its image.

    For example:
      plateau cancel 3f9ac2d01b77
    """
    from plateau.commands.jobs import cancel as run

    with plain_errors():
        run(job_id, url=url, as_json=as_json)


@command()
def pause(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Pause a rendering job; workers finish the slices they have and take no more of it.

    For example:
      plateau pause 3f9ac2d01b77
      plateau resume 3f9ac2d01b77

    What is rendered already is merged and judged, so the job may still converge. Its time limit
    stands still. A job that only has to wait its turn needs a lower priority instead.
    """
    from plateau.commands.jobs import pause as run

    with plain_errors():
        run(job_id, url=url, as_json=as_json)


@command()
def resume(job_id: o.JobId, url: o.Url = None, as_json: o.Json = False) -> None:
    """Let a paused job go on where it stood; its image is as if it had never been paused.

    For example:
      plateau resume 3f9ac2d01b77
    """
    from plateau.commands.jobs import resume as run

    with plain_errors():
        run(job_id, url=url, as_json=as_json)


@command(takes_negative_numbers=True)
def priority(
    job_id: o.JobId,
    value: Annotated[
        int,
        typer.Argument(
            metavar="N", help="Higher is served first; jobs start with 0.", min=-1000, max=1000
        ),
    ],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Change a job's priority; the next slice that a worker takes goes by it.

    For example:
      plateau priority 3f9ac2d01b77 10
      plateau priority 3f9ac2d01b77 -10

    Workers serve the highest priority first, and share themselves among jobs of the same. None
    stops in the middle of a slice.
    """
    from plateau.commands.jobs import priority as run

    with plain_errors():
        run(job_id, value, url=url, as_json=as_json)
