"""Removes blobs that nothing refers to.

A job is in Redis before its first blob is put, and its id is never reused. So a blob whose job
Redis does not know after the listing belongs to a job that is gone for good. The set of results and
the ledger of a finished job do not change any more, so its other results and partials are leftovers
of processes that were killed or late. Blobs of unfinished jobs, and of unknown kinds, are left.

Extensions name the orphans among their own blobs.
"""

from collections.abc import Callable, Collection
from itertools import groupby

from plateau.extensions import extensions
from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import StoredBlob
from plateau.farm.ledger import records
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.model.spec import stored_spec
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.sweep.removal import Removal


def remove_orphans(client: RedisClient, removal: Removal, forgotten: Collection[str]) -> int:
    """Remove blobs of unknown jobs, and unneeded ones of finished jobs; returns how many.

    The sweep has removed, or counted, the blobs of `forgotten` jobs already.
    """
    found: dict[str, list[StoredBlob]] = {}
    # A listing usually has a job's blobs in a row; otherwise the job is read again.
    listing = removal.store.listing(blobs.JOBS)
    for job_id, stored in groupby(listing, lambda blob: blobs.in_job(blob.name)[0]):
        if job_id not in forgotten:
            keeps = _keeps(client, job_id)
            for blob in stored:
                if not keeps(blob.name):
                    found.setdefault(job_id, []).append(blob)
    removed = 0
    for job_id, orphans in found.items():
        keeps = _keeps(client, job_id)
        removed += removal.remove(blob for blob in orphans if not keeps(blob.name))
    for extension in extensions("ledger"):
        removed += removal.remove(extension.orphans(client, removal.store))
    return removed


def _keeps(client: RedisClient, job_id: str) -> Callable[[str], bool]:
    """A function of a blob's name: whether the job, as Redis has it now, keeps the blob."""
    spec, finished_at, results, checkpoint = client.hmget(
        keys.job(job_id), "spec", "finished_at", "results", "checkpoint"
    )
    if spec is None:
        return lambda _: False
    if finished_at is None:
        return lambda _: True
    kept: set[str] = set()
    try:
        keeps_slices = stored_spec(spec).keep_slices
    except ValueError:  # such as of a rule that is not installed here
        return lambda _: True
    if keeps_slices:
        ledger = records.ledger(client.hgetall(keys.job(job_id, "ledger")))
        kept = {record["blob"] for record in ledger.values()}
    if checkpoint is not None:
        kept.add(Checkpoint.model_validate_json(checkpoint).blob)
    swept = (blobs.partials(job_id), blobs.checkpoints(job_id), blobs.results(job_id))
    return lambda name: (
        name in kept or name.startswith(f"{results or ''}/") or not name.startswith(swept)
    )
