"""`plateau drain | usage`: workers that are to stop, and what the jobs have cost."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.connect import connect
from plateau.commands.printing import print_one, print_table
from plateau.errors import tell

if TYPE_CHECKING:
    from plateau.farm.model.usage import UsageRow


@app.command()
def drain(
    worker_id: Annotated[
        str,
        typer.Argument(metavar="WORKER", help="The worker's id, as `plateau list workers` has it."),
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
    with connect(url) as client:
        worker = client.undrain(worker_id) if undo else client.drain(worker_id)
    state = "drained" if worker.drained else "takes slices"
    print_one(worker, f"{worker.id} {state}", as_json=as_json)


@app.command()
def usage(
    by: Annotated[
        Literal["job", "batch", "owner", "week"], typer.Option(help="What a row is.")
    ] = "week",
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
    from plateau.farm.wire.figures import significant
    from plateau.farm.wire.usage_views import usage_csv

    if as_csv and as_json:
        raise typer.BadParameter("--csv and --json are two forms: choose one")
    with connect(url) as client:
        found = client.usage(by, since=since, until=until)
    if as_csv:
        print(usage_csv(found), end="")
        return
    if as_json:
        print(found.model_dump_json(indent=2))
        return
    columns = (by, "name", "jobs", "core hours", "saved")
    none = "there is no job of that time"
    print_table(found.rows, columns, _usage_row, none=none, spare=("saved", "name", "jobs"))
    if found.rows:
        total = found.total
        of = "1 job" if total.jobs == 1 else f"{total.jobs:,} jobs"
        tell(f"{of}: {significant(total.core_hours)} core hours")


def _usage_row(row: "UsageRow") -> tuple[str, ...]:
    from plateau.farm.wire.figures import significant

    return (
        row.key or "–",
        row.name or "–",
        f"{row.jobs:,}",
        significant(row.core_hours),
        significant(row.saved_core_hours),
    )
