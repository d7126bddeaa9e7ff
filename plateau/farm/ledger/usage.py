"""What the stored jobs have cost, summed by job, batch, owner or week.

A job counts as a whole where it was submitted. So a sum of the past changes only while its jobs
render, and a job that was removed is missing from it.
"""

import heapq
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Final

from plateau.farm.ledger import costs, records
from plateau.farm.model.job import moment
from plateau.farm.model.usage import Grouping, UsageRow
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient

#: Jobs read in one round trip, between which Redis serves others.
_AT_ONCE: Final = 500

_FIELDS: Final = (
    *("name", "batch", "created_at", "machine_ms", "further_core_ms", "wasted_ms"),
    *("samples_saved", "committed", "committed_samples", "slice_spp", "again"),
    *("width", "height"),
)


def usage(
    client: RedisClient,
    by: Grouping,
    *,
    since: datetime | None = None,
    until: datetime | None = None,
    limit: int,
) -> tuple[list[UsageRow], int, UsageRow]:
    """The sums of the jobs that were submitted from `since` on and before `until`.

    Returns the `limit` sums of the most core hours, weeks by time and others by core hours; how
    many were left out; and the sum of all.
    """
    rows: dict[str, UsageRow] = {}
    total = UsageRow(key="", name="")
    for one in _jobs(client, by, since, until):
        total.add(one)
        if (row := rows.setdefault(one.key, one)) is not one:
            row.add(one)
    most = heapq.nlargest(limit, rows.values(), key=lambda row: row.core_hours)
    if by == "week":
        most.sort(key=lambda row: row.key)
    return most, len(rows) - len(most), total


def _jobs(
    client: RedisClient, by: Grouping, since: datetime | None, until: datetime | None
) -> Iterator[UsageRow]:
    """What each job has spent, newest first, read in portions."""
    before = "+inf"
    while True:
        rows = client.zrevrangebyscore(
            keys.JOBS, before, "-inf", start=0, num=_AT_ONCE, withscores=True
        )
        job_ids = [job_id for job_id, _ in rows]
        found = records.fields_of(client, job_ids, _FIELDS)
        owners = records.fields_of(client, job_ids, ("owner", "owner_name"), "sealed")
        for job_id, fields, owner in zip(job_ids, found, owners, strict=True):
            if fields["name"] is None:  # forgotten a moment ago
                continue
            with records.leaving_out_unreadable(), records.reading(job_id):
                created_at = moment(fields["created_at"] or "")
                if since is not None and created_at < since:
                    return
                if until is None or created_at < until:
                    yield _spent(by, job_id, fields, owner, created_at)
        if len(rows) < _AT_ONCE:
            return
        before = f"({int(rows[-1][1])}"


def _spent(
    by: Grouping,
    job_id: str,
    fields: Mapping[str, str | None],
    owner: Mapping[str, str | None],
    created_at: datetime,
) -> UsageRow:
    key, name = {
        "job": (job_id, fields["name"]),
        "batch": (fields["batch"], ""),
        "owner": (owner["owner"], owner["owner_name"]),
        "week": ("{}-W{:02}".format(*created_at.isocalendar()), ""),
    }[by]
    return UsageRow(
        key=key or "",
        name=name or "",
        jobs=1,
        machine_s=int(fields["machine_ms"] or 0) / 1000,
        wasted_s=int(fields["wasted_ms"] or 0) / 1000,
        core_hours=costs.core_hours(fields),
        saved_core_hours=costs.saved_core_hours(fields, int(fields["slice_spp"] or 0)),
    )
