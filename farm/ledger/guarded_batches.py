"""Guarded batches in Redis: all their jobs stop at the same visible noise."""

from plateau.farm.model.errors import UnevenBatch
from plateau.farm.model.flicker import differences, stops_by
from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import unavailable_as_farm_error


def compared(client: RedisClient, batch: str, spec: JobSpec) -> str:
    """The number of the batch's newest job, once a new job of this spec may join the batch.

    "" where nothing guards the batch, or where it has no jobs yet.

    Raises
    ------
    UnevenBatch
        The batch is guarded, and the new job is not even with its jobs.
    """
    with unavailable_as_farm_error():
        pipe = client.pipeline(transaction=True)
        pipe.zscore(keys.BATCHES, batch)
        pipe.sismember(keys.GUARDED, batch)
        newest, guarded = pipe.execute()
        if newest is None or not (guarded or spec.flicker_guard):
            return ""
        # All jobs of a guarded batch are even, so one of them stands for all.
        job_ids = client.zrevrange(keys.batch(batch), 0, 0 if guarded else -1)
        pipe = client.pipeline(transaction=False)
        for job_id in job_ids:
            pipe.hget(keys.job(job_id), "spec")
        specs = pipe.execute()
    asked = stops_by(spec)
    for job_id, stored in zip(job_ids, specs, strict=True):
        if stored is None:  # forgotten a moment ago
            continue
        found = differences(asked, stops_by(stored_spec(stored)))
        if found:
            raise UnevenBatch(batch, job_id, [(one.field, one.value, one.others) for one in found])
    return f"{newest:.0f}"
