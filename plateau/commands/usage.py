"""`plateau usage`: what the jobs have cost in sum."""

from plateau.commands.connect import connect
from plateau.errors import tell
from plateau.farm.model.usage import Grouping
from plateau.farm.wire.figures import significant
from plateau.farm.wire.usage_views import UsageRow
from plateau.terminal.tables import print_rows

_SPARE = ("saved", "name", "jobs")


def usage(
    by: Grouping,
    *,
    since: str | None,
    until: str | None,
    url: str | None,
    as_csv: bool,
    as_json: bool,
) -> None:
    """Print the sums as a table, CSV or JSON, and their total on standard error."""
    with connect(url) as client:
        if as_csv:
            print(client.usage_csv(by, since=since, until=until), end="")
            return
        found = client.usage(by, since=since, until=until)
    if as_json:
        print(found.model_dump_json(indent=2))
        return
    print_rows(
        (by, "name", "jobs", "core hours", "saved"),
        [_row(row) for row in found.rows],
        none="there is no job of that time",
        spare=_SPARE,
    )
    if found.rows:
        total = found.total
        of = "1 job" if total.jobs == 1 else f"{total.jobs:,} jobs"
        tell(f"{of}: {significant(total.core_hours)} core hours")


def _row(row: UsageRow) -> tuple[str, ...]:
    return (
        row.key or "–",
        row.name or "–",
        f"{row.jobs:,}",
        significant(row.core_hours),
        significant(row.saved_core_hours),
    )
