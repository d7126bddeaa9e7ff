"""`plateau gc`: removes old jobs, unused scenes and orphaned blobs."""

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.printing import print_json
from plateau.errors import CommandFailed

if TYPE_CHECKING:
    from plateau.farm.sweep import Swept

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
            "Until then, `plateau delete --undo` restores them.",
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
    from plateau.farm.blobs.store import Blobs
    from plateau.farm.ledger.pairing import check_pair
    from plateau.farm.ledger.schema import check_schema
    from plateau.farm.redis.link import connect
    from plateau.farm.sweep import in_seconds, sweep
    from plateau.processes.data_folder import DataFolder
    from plateau.processes.read_settings import farm_settings
    from plateau.processes.redis_at_hand import redis_at_hand

    settings = farm_settings()
    if results_older_than is None:
        results_older_than = settings.keep_results_days
    if deleted_older_than is None:
        deleted_older_than = settings.keep_deleted_days
    if sums_older_than is None:
        sums_older_than = settings.keep_sums_days
    if scenes_unused_for is None:
        scenes_unused_for = settings.keep_results_days
    data = DataFolder(settings.data)
    if settings.redis_url and settings.blobs is None:
        raise CommandFailed(
            "set PLATEAU_BLOBS too: it is the store from which to remove the blobs that no job in "
            "PLATEAU_REDIS_URL needs"
        )
    where = settings.blobs or str(data.blobs.absolute())
    with ExitStack() as stack:
        client = stack.enter_context(connect(redis_at_hand(settings, data, stack)))
        store = Blobs(where)
        check_schema(client)
        check_pair(client, store)
        swept = sweep(
            client,
            store,
            results_older_than_s=in_seconds(results_older_than),
            deleted_older_than_s=in_seconds(deleted_older_than),
            sums_older_than_s=in_seconds(sums_older_than),
            scenes_unused_for_s=in_seconds(scenes_unused_for),
            dry_run=dry_run,
        )
    if as_json:
        print_json({"dry_run": dry_run, **asdict(swept)})
    else:
        lines = (
            _line("jobs", swept.jobs, "finished", results_older_than, "results-older-than"),
            _line("deleted", swept.deleted, "jobs, deleted", deleted_older_than),
            _line("sums", swept.sums, "of jobs finished", sums_older_than),
            _line(
                "scenes",
                swept.scenes,
                "of no job, last used",
                scenes_unused_for,
                "scenes-unused-for",
            ),
        )
        print(_report(swept, lines, where, dry_run=dry_run))


def _report(swept: "Swept", lines: Iterable[str], where: str, *, dry_run: bool) -> str:
    from plateau.farm.wire.job_text import size

    verb = "Would remove" if dry_run else "Removed"
    count = "1 blob" if swept.blobs == 1 else f"{swept.blobs:,} blobs"
    return "\n".join(
        (
            f"{verb} {count}, {size(swept.freed_bytes)}, from {where}:",
            *lines,
            f"  {'orphans':<8}{swept.orphans:>8,}  blobs that no job needs",
        )
    )


def _line(name: str, count: int, condition: str, days: float | None, option: str = "") -> str:
    if days is None:
        return f"  {name:<8}{'–':>8}  kept for ever: --{option} DAYS sets a limit"
    return f"  {name:<8}{count:>8,}  {condition} more than {days:g} days ago"
