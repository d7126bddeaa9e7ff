"""Commands that control jobs and batches, delete those that have ended, and render them again."""

from typing import Annotated, Any

import typer

from plateau.cli import options as o
from plateau.cli.app import app


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
    job_id: o.OrJobId = None, batch: o.OrBatch = None, url: o.Url = None, as_json: o.Json = False
) -> None:
    """Delete an ended job, or those of a batch. It can be undone for a while.

    For example:
      plateau delete 3f9ac2d01b77
      plateau list --deleted
      plateau restore 3f9ac2d01b77

    A deleted job leaves the list and its batch at once. It is removed with all its files after
    PLATEAU_KEEP_DELETED_DAYS (7 unless set), as soon as no other job continues it.
    """
    _steer(job_id, batch, "delete", url=url, as_json=as_json)


@app.command()
def restore(
    job_id: o.OrJobId = None, batch: o.OrBatch = None, url: o.Url = None, as_json: o.Json = False
) -> None:
    """Put a deleted job, or those of a batch, back into the list.

    For example:
      plateau restore 3f9ac2d01b77
      plateau restore --batch walk
    """
    _steer(job_id, batch, "restore", url=url, as_json=as_json)


def _steer(
    job_id: str | None, batch: str | None, action: str, *, url: str | None, as_json: bool
) -> None:
    """Change the one of the two that is named."""
    from plateau.commands.batches import steer as steer_batch
    from plateau.commands.jobs import steer as steer_job

    job = o.one_of(job_id, batch)
    if batch is None:
        steer_job(job, action, url=url, as_json=as_json)
    else:
        steer_batch(batch, action, url=url, as_json=as_json)


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
    from plateau.commands.jobs import priority as run

    run(job_id, value, url=url, as_json=as_json)


@app.command()
@o.takes_changes(but={"shot"})
def again(
    job_id: o.JobId, changes: dict[str, Any], url: o.Url = None, as_json: o.Json = False
) -> None:
    """Render an ended job again, with the samples that it has, and print the new job's id.

    For example:
      plateau again 3f9ac2d01b77 --rule visible:target=0.0001
      plateau again 3f9ac2d01b77 --seed 1
      plateau watch $(plateau again 3f9ac2d01b77 --max-spp 20000) -o out

    Options that are not given are as in the old job, which stays as it is. The new job keeps the
    old one's samples if they are left and the changes allow it; standard error says how many, or
    why none. A stricter rule and a higher cap allow it, but on scalar_rgb not every cap does. If
    the old job kept its slices (--keep-slices), the view and the step may change too, and with a
    --max-spp that is not beyond them nothing is rendered. Another --seed draws other samples.
    """
    from plateau.commands.jobs import again as run

    run(job_id, changes, url=url, as_json=as_json)
