"""Lists jobs, newest first: all, in a state, of a batch or of an owner.

Each of the four has an index, so the cost of a page does not grow with the stored jobs.
"""

from typing import Final

from plateau.farm.ledger import records
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import unavailable_as_farm_error

#: Jobs of an index that are filtered together.
_LOOKED_AT: Final = 500


def jobs_before(
    client: RedisClient,
    *,
    state: JobState | None = None,
    batch: str | None = None,
    owner: str | None = None,
    before: int | None = None,
    limit: int = 50,
) -> tuple[list[Job], int | None]:
    """The newest jobs, and the next page's number, None after the last page.

    Only those below the number `before`, which an earlier call returned, in this state, of this
    batch and of this owner (an API key's id).
    """
    index, wanted = _index(state, batch, owner)
    found: list[Job] = []
    with unavailable_as_farm_error():
        while True:
            asked = _LOOKED_AT if wanted else limit - len(found)
            rows = client.zrevrangebyscore(
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
            if wanted:
                rows = _matching(client, rows, wanted)
                if len(found) + len(rows) > limit:
                    rows, more = rows[: limit - len(found)], True
                    before = int(rows[-1][1])
            # A job may have left the state since its index was read.
            found += (
                job for job in _jobs(client, [row[0] for row in rows]) if state in {None, job.state}
            )
            if not more:
                return found, None
            if len(found) >= limit:
                return found, before


def _index(
    state: JobState | None, batch: str | None, owner: str | None
) -> tuple[str, dict[str, str]]:
    """The index that has the wanted jobs, and the fields by which they are still to be filtered."""
    wanted = {} if state is None else {"state": state.value}
    if batch is not None:
        return keys.batch(batch), wanted if owner is None else {"owner": owner, **wanted}
    if owner is not None:
        return keys.jobs_of_key(owner), wanted
    return keys.JOBS if state is None else keys.in_state(state.value), {}


def _matching(
    client: RedisClient, rows: list[tuple[str, float]], wanted: dict[str, str]
) -> list[tuple[str, float]]:
    pipe = client.pipeline(transaction=False)
    for job_id, _ in rows:
        for field in wanted:
            pipe.hget(keys.job(job_id, "sealed") if field == "owner" else keys.job(job_id), field)
    found = iter(pipe.execute())
    return [row for row in rows if [next(found) for _ in wanted] == list(wanted.values())]


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
