"""`plateau cancel | pause | resume | delete | priority`: controls jobs and batches."""

from typing import Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_one


@app.command()
def cancel(
    job_id: o.OrJobId = None, batch: o.OrBatch = None, url: o.Url = None, as_json: o.Json = False
) -> None:
    """Cancel a job or a batch. The image merged so far is kept.

    For example:
      plateau cancel 3f9ac2d01b77
      plateau cancel --batch walk
    """
    _steer(job_id, batch, "cancel", url=url, as_json=as_json)


@app.command()
def pause(
    job_id: o.OrJobId = None, batch: o.OrBatch = None, url: o.Url = None, as_json: o.Json = False
) -> None:
    """Pause a rendering job or a batch: workers finish their slices and take no more.

    For example:
      plateau pause 3f9ac2d01b77
      plateau pause --batch walk
      plateau resume 3f9ac2d01b77

    Slices that are already rendered are merged and judged, so the job may still converge. Its time
    limit is suspended. To let other jobs go first, lower the priority instead.
    """
    _steer(job_id, batch, "pause", url=url, as_json=as_json)


@app.command()
def resume(
    job_id: o.OrJobId = None, batch: o.OrBatch = None, url: o.Url = None, as_json: o.Json = False
) -> None:
    """Resume a paused job or batch. A pause does not change the image.

    For example:
      plateau resume 3f9ac2d01b77
      plateau resume --batch walk
    """
    _steer(job_id, batch, "resume", url=url, as_json=as_json)


@app.command()
def delete(
    job_id: o.OrJobId = None,
    batch: o.OrBatch = None,
    undo: Annotated[
        bool, typer.Option("--undo", help="Put what was deleted back into the list.")
    ] = False,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Delete an ended job, or those of a batch. It can be undone for a while.

    For example:
      plateau delete 3f9ac2d01b77
      plateau list --deleted
      plateau delete --undo 3f9ac2d01b77
      plateau delete --undo --batch walk

    A deleted job leaves the list and its batch at once. It is removed with all its files after
    PLATEAU_KEEP_DELETED_DAYS (7 unless set), as soon as no other job continues it.
    """
    _steer(job_id, batch, "restore" if undo else "delete", url=url, as_json=as_json)


def _steer(
    job_id: str | None, batch: str | None, action: str, *, url: str | None, as_json: bool
) -> None:
    """Change the one of the two that is named, and print the outcome for each job."""
    given = o.one_of(job_id, batch)
    with connect(url) as client:
        if batch is not None:
            steered = getattr(client, f"{action}_batch")(batch)
            lines = [
                f"{one.job}{f' {one.state.in_words}' if one.state else ''}"
                f"{f' ({one.why_not})' if one.why_not else ''}"
                for one in steered.jobs
            ]
            print_one(steered, "\n".join(lines), as_json=as_json)
            return
        job = getattr(client, action)(client.whole_id(given))
    shown = f"{job.id} {job.outcome}{', deleted' if job.deleted_at else ''}"
    print_one(job, shown, as_json=as_json)


@app.command(context_settings={"ignore_unknown_options": True})  # -5 is a priority
def priority(
    job_id: o.JobId,
    value: Annotated[
        int,
        typer.Argument(
            metavar="N", help="Higher is rendered first; the default is 0.", min=-1000, max=1000
        ),
    ],
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """Change the priority of a job, from the next slice on.

    For example:
      plateau priority 3f9ac2d01b77 10
      plateau priority 3f9ac2d01b77 -10

    Workers render jobs of the highest priority first, and share their time among jobs of equal
    priority. No worker stops in the middle of a slice.
    """
    with connect(url) as client:
        job = client.set_priority(client.whole_id(job_id), value)
    print_one(job, f"{job.id} {job.state.value}, priority {job.spec.priority}", as_json=as_json)
