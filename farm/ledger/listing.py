"""Lists jobs by their number of creation, newest first: all, in a state, of a batch or an owner.

Each of the four has an index, so a page costs what is on it and not what is stored.
"""

from typing import Final

from plateau.farm.ledger import records
from plateau.farm.model.job import Job
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import unavailable_as_farm_error

#: Of a batch's jobs, so many states are looked at together.
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
    """The newest jobs below the number `before`, and the number to go on from, if there are more.

    Parameters
    ----------
    state, batch, owner
        Only jobs in this state, of this batch, or of this owner (an API key's id).
    before
        A number that an earlier call returned.
    limit
        Most jobs to return.
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
            # One that has moved on since its index was read is in the wrong place by now.
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
    """The index that has what is wanted, and the fields that its jobs are still to be sieved by."""
    wanted = {
        field: value
        for field, value in (("batch", batch), ("owner", owner), ("state", state))
        if value is not None
    }
    if batch is not None:
        del wanted["batch"]
        return keys.batch(batch), wanted
    if owner is not None:
        del wanted["owner"]
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
    """These jobs, but for those that were forgotten a moment ago, or cannot be read."""
    pipe = client.pipeline(transaction=False)
    for job_id in job_ids:
        records.ask_for(pipe, job_id)
    found, answers = [], iter(pipe.execute())
    for job_id, fields, sealed in zip(job_ids, answers, answers, strict=True):
        if fields:
            with records.leaving_out_unreadable():
                found.append(records.job(job_id, fields, sealed))
    return found
