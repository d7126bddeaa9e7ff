"""`plateau list | batches`: the jobs and batches of the service."""

from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.options import complete
from plateau.commands.printing import print_table
from plateau.errors import CommandFailed, tell
from plateau.farm.model.states import JobState
from plateau.farm.wire import figures

if TYPE_CHECKING:
    from plateau.farm.wire.batch_views import BatchLineView
    from plateau.farm.wire.views import JobView

_PAGE = 100
_WAITING = 5  #: most jobs without a fitting worker that are named
_JOB = (
    *("id", "state", "spp", "noise left", "time", "to come", "created (UTC)"),
    *("by", "batch", "job"),
)
_SPARE = ("by", "created (UTC)", "batch", "time", "to come")  # on a narrow terminal
_BATCH = ("batch", "jobs", "states", "newest (UTC)")


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
    jobs: list[JobView] = []
    cursor = None
    with connect(url) as client:
        while len(jobs) < limit:
            page = client.jobs(
                state=_state(state),
                batch=batch,
                owner=owner,
                search=search,
                deleted=deleted,
                cursor=cursor,
                limit=min(limit - len(jobs), _PAGE),
            )
            jobs += page.jobs
            cursor = page.next_cursor
            if cursor is None:
                break
    print_table(jobs, _JOB, _job_row, none="no jobs", spare=_SPARE, as_json=as_json)
    if not as_json:
        _warn_of_waiting([job for job in jobs if job.waits_for])


def _state(name: str | None) -> JobState | None:
    try:
        return None if name is None else JobState(name)
    except ValueError:
        states = ", ".join(state.value for state in JobState)
        raise CommandFailed(f"there is no state {name!r}; the states are {states}") from None


def _warn_of_waiting(jobs: "list[JobView]") -> None:
    """Name on standard error the jobs that wait for others, or that no worker can render."""
    for job in jobs[:_WAITING]:
        tell(f"job {job.id} {job.waits_for}")
    if len(jobs) > _WAITING:
        tell(f"and {len(jobs) - _WAITING} others wait too")


def _job_row(job: "JobView") -> tuple[str, ...]:
    from plateau.farm.model.job import utc_now
    from plateau.farm.wire import job_text

    left = "–" if job.estimate_fraction is None else figures.percent(job.estimate_fraction)
    return (
        job.id,
        job.outcome,
        f"{job.spp}/{job.spec.max_spp}",
        left,
        figures.duration(job.duration_s(utc_now())),
        job_text.time_left(job, utc_now()) or "–",
        f"{job.created_at:%Y-%m-%d %H:%M:%S}",
        job.owner_name or "–",
        job.spec.batch or "–",
        job_text.name_with_parameters(job),
    )


@app.command()
def batches(
    limit: Annotated[int, typer.Option(help="Most batches to list.", min=1, max=10_000)] = 20,
    url: o.Url = None,
    as_json: o.Json = False,
) -> None:
    """List batches; those with the newest jobs first.

    For example:
      plateau batches
      plateau list --batch walk

    `plateau submit` makes a batch with --each or --parameters, or adds a job to one with --batch.
    """
    with connect(url) as client:
        found = [line for _, line in zip(range(limit), client.all_batches(), strict=False)]
    spare = ("newest (UTC)",)
    print_table(found, _BATCH, _batch_row, none="no batches", spare=spare, as_json=as_json)


def _batch_row(line: "BatchLineView") -> tuple[str, ...]:
    from plateau.terminal.batch_progress import in_states

    newest = f"{line.newest_at:%Y-%m-%d %H:%M:%S}"
    return (line.name, str(line.jobs), in_states(line.states), newest)
