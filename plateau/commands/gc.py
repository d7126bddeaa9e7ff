"""`plateau gc`: removes old jobs, unused scenes and orphaned blobs."""

import json
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import asdict
from typing import Final

from plateau.errors import CommandFailed
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import check_schema
from plateau.farm.redis.link import connect
from plateau.farm.sweep import Swept, sweep
from plateau.farm.wire.job_text import size
from plateau.processes.data_folder import DataFolder
from plateau.processes.read_settings import farm_settings
from plateau.processes.redis_at_hand import redis_at_hand

_DAY_S: Final = 86_400.0


def gc(
    results_older_than_days: float | None,
    deleted_older_than_days: float | None,
    sums_older_than_days: float | None,
    scenes_unused_for_days: float | None,
    *,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Sweep once and print what was removed; for None, the days of the settings apply."""
    settings = farm_settings()
    if results_older_than_days is None:
        results_older_than_days = settings.keep_results_days
    if deleted_older_than_days is None:
        deleted_older_than_days = settings.keep_deleted_days
    if sums_older_than_days is None:
        sums_older_than_days = settings.keep_sums_days
    if scenes_unused_for_days is None:
        scenes_unused_for_days = settings.keep_results_days
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
            results_older_than_s=_seconds(results_older_than_days),
            deleted_older_than_s=_seconds(deleted_older_than_days),
            sums_older_than_s=_seconds(sums_older_than_days),
            scenes_unused_for_s=_seconds(scenes_unused_for_days),
            dry_run=dry_run,
        )
    if as_json:
        print(json.dumps({"dry_run": dry_run, **asdict(swept)}, indent=2))
    else:
        lines = (
            _line("jobs", swept.jobs, "finished", results_older_than_days, "results-older-than"),
            _line("deleted", swept.deleted, "jobs, deleted", deleted_older_than_days),
            _line("sums", swept.sums, "of jobs finished", sums_older_than_days),
            _line(
                "scenes",
                swept.scenes,
                "of no job, last used",
                scenes_unused_for_days,
                "scenes-unused-for",
            ),
        )
        print(_report(swept, lines, where, dry_run=dry_run))


def _report(swept: Swept, lines: Iterable[str], where: str, *, dry_run: bool) -> str:
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


def _seconds(days: float | None) -> float | None:
    return None if days is None else days * _DAY_S
