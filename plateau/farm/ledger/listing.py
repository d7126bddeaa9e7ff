"""Lists jobs, newest first: all, or those that a filter lets through.

All jobs, those in a state, of a batch, of an owner and the deleted ones have an index each. So the
cost of a page does not grow with the stored jobs where one of them has what is asked for, but for
the deleted jobs that it passes over. Otherwise jobs of one index are read until the page is full.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from plateau.farm.ledger import records
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient

#: Jobs of an index that are filtered together.
_AT_ONCE: Final = 500

#: A job of an index, and its number of creation.
_Row = tuple[str, float]


@dataclass(frozen=True, kw_only=True)
class Filter:
    """Which jobs are wanted; None wants all."""

    state: JobState | None = None
    batch: str | None = None  #: the jobs that were submitted to it
    owner: str | None = None  #: an API key's id
    deleted: bool | None = False
    search: str = ""  #: words that all occur in what the job is called and belongs to


def jobs_before(
    client: RedisClient, wanted: Filter, *, before: int | None = None, limit: int = 50
) -> tuple[list[Job], int | None]:
    """The newest wanted jobs, and the next page's number, None after the last page.

    Only those below the number `before`, which an earlier call returned.
    """
    index, fields = _index(wanted)
    found: list[Job] = []
    asked = _AT_ONCE if fields or wanted.search else limit
    while True:
        rows: list[_Row] = client.zrevrangebyscore(
            index,
            f"({before}" if before is not None else "+inf",
            "-inf",
            start=0,
            num=asked,
            withscores=True,
        )
        more = len(rows) == asked
        if rows:
            before = int(rows[-1][1])
        rows = _kept(client, rows, deleted=wanted.deleted)
        rows = _matching(client, rows, fields, wanted.search)
        if len(found) + len(rows) > limit:
            rows, more = rows[: limit - len(found)], True
            before = int(rows[-1][1])
        # A job may have left the state since its index was read.
        found += (
            job
            for job in _jobs(client, [row[0] for row in rows])
            if wanted.state in {None, job.state}
        )
        if not more:
            return found, None
        if len(found) >= limit:
            return found, before
        asked = _AT_ONCE


def _index(wanted: Filter) -> tuple[str, dict[str, str]]:
    """The index that has the wanted jobs, and the fields by which they are still to be filtered."""
    given = {
        "batch": wanted.batch,
        "owner": wanted.owner,
        "state": wanted.state and wanted.state.value,
    }
    fields = {name: value for name, value in given.items() if value is not None}
    if wanted.deleted:
        return keys.DELETED, fields
    if wanted.batch is not None and wanted.deleted is False:
        return keys.batch(fields.pop("batch")), fields
    if wanted.owner is not None:
        return keys.jobs_of_key(fields.pop("owner")), fields
    if wanted.state is not None:
        return keys.in_state(fields.pop("state")), fields
    return keys.JOBS, fields


def _kept(client: RedisClient, rows: list[_Row], *, deleted: bool | None) -> list[_Row]:
    """Those that are deleted, or those that are not, as wanted."""
    if not rows or deleted is None:
        return rows
    scores = client.zmscore(keys.DELETED, [row[0] for row in rows])
    return [row for row, score in zip(rows, scores, strict=True) if (score is not None) is deleted]


def _matching(
    client: RedisClient, rows: list[_Row], fields: dict[str, str], search: str
) -> list[_Row]:
    """Those with these fields in which each word of the search occurs."""
    words = search.lower().split()
    if not rows or not (fields or words):
        return rows
    wanted = {name: value for name, value in fields.items() if name != "owner"}
    asked = (*wanted, "party", *(("name", "spec") if words else ()))
    texts: dict[_Row, str] = {}
    found = records.fields_of(client, (job_id for job_id, _ in rows), asked)
    for row, had in zip(rows, found, strict=True):
        if all(had[name] == value for name, value in wanted.items()):
            text = _text(row[0], had, words)
            if had["party"] or _has(text, words):
                texts[row] = text
    # Owners are read only where they decide.
    unsure = [row for row, text in texts.items() if "owner" in fields or not _has(text, words)]
    names, job_ids = ("owner", "owner_name"), (job_id for job_id, _ in unsure)
    owners = dict(zip(unsure, records.fields_of(client, job_ids, names, "sealed"), strict=True))
    return [
        row
        for row, text in texts.items()
        if row not in owners
        or (
            fields.get("owner") in {None, owners[row]["owner"]}
            and _has(f"{text}\n{owners[row]['owner_name'] or ''}".lower(), words)
        )
    ]


def _has(text: str, words: Sequence[str]) -> bool:
    return all(word in text for word in words)


def _text(job_id: str, fields: dict[str, str | None], words: Sequence[str]) -> str:
    """What a search looks at besides the owner: a job's id, its names, its batch and its tags."""
    if not words:
        return ""
    try:
        spec = json.loads(fields["spec"] or "{}")
        texts = (fields["name"], spec.get("name"), spec.get("batch"), *spec.get("requires", ()))
        return "\n".join(filter(None, (job_id, *texts))).lower()
    except (AttributeError, TypeError, ValueError):  # no list has an unreadable job
        return ""


def _jobs(client: RedisClient, job_ids: list[str]) -> list[Job]:
    """These jobs, without those that were forgotten a moment ago or cannot be read."""
    pipe = client.pipeline(transaction=False)
    for job_id in job_ids:
        records.ask_for(pipe, job_id)
    found, answers = [], iter(pipe.execute())
    for job_id, fields, sealed in zip(job_ids, answers, answers, strict=True):
        if fields:
            with records.leaving_out_unreadable():
                found.append(records.job(job_id, fields, sealed))
    return found
