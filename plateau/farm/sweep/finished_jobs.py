"""Forgets finished jobs, and drops the sums from which another job could have continued.

Only a finished job is forgotten: it needs no monitor any more. A zombie worker learns that the job
has ended, and a zombie monitor loses its fence; the blobs that they put are orphans.

A job that another one continues stays as long as that one, which may depend on its slices. Its sums
stay until the other job has its own, or has dropped these, too.
"""

from collections import defaultdict
from collections.abc import Iterator
from typing import Final

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import StoredBlob
from plateau.farm.ledger.ownership import Checkpoint
from plateau.farm.ledger.records import fields_of
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.sweeps import DropSums, Forget
from plateau.farm.redis.link import now_ms
from plateau.farm.redis.scripts import OnRedis
from plateau.farm.sweep.removal import Removal

_PAGE: Final = 500  #: jobs that are read at once


class FinishedJobs(OnRedis):
    """The finished jobs, as one sweep finds them."""

    def __init__(self, client: RedisClient, removal: Removal) -> None:
        super().__init__(client)
        self._removal = removal
        self.forgotten: set[str] = set()  #: in a dry run, the jobs that would be
        self.sums = 0  #: dropped checkpoints of jobs that stay

    def forget(self, older_than_s: float) -> None:
        """Forget the jobs that finished this long ago."""
        ms = round(older_than_s * 1000)
        self._forget([Forget(job=one, finished_for_ms=ms) for one in self._finished_for(ms)])

    def forget_deleted(self, older_than_s: float) -> None:
        """Forget the finished jobs that were deleted this long ago."""
        ms = round(older_than_s * 1000)
        self._forget([Forget(job=one, deleted_for_ms=ms) for one in self._deleted_for(ms)])

    def _forget(self, commands: list[Forget]) -> None:
        """Forget these jobs, newest first, so continuing jobs before the old."""
        continuing = self._continuing()
        for forget in commands:
            job_id = forget.job
            if self._removal.dry_run:
                goes = self.forgotten.issuperset(continuing[job_id])
            else:
                goes = self._scripts.run(forget) == "forgotten"
            if goes:
                self.forgotten.add(job_id)
                stored = self._removal.store.listing(blobs.of_job(job_id))
                self._removal.remove(list(stored))

    def let_sums_go(self, older_than_s: float) -> None:
        """Drop the sums of jobs that finished this long ago."""
        older_than_ms = round(older_than_s * 1000)
        continuing, left = self._continuing(), dict(field_of_all(self._redis, "checkpoint"))
        for job_id in self.forgotten:
            left[job_id] = None
        for job_id in self._finished_for(older_than_ms):
            checkpoint, others = left.get(job_id), continuing[job_id]
            if checkpoint is None:
                continue
            if self._removal.dry_run:
                goes = all(left.get(other) != checkpoint for other in others)
            else:
                drop = DropSums(
                    job=job_id, finished_for_ms=older_than_ms, continued_by=tuple(others)
                )
                goes = self._scripts.run(drop) == "dropped"
            if goes:
                left[job_id] = None
                blob = Checkpoint.model_validate_json(checkpoint).blob
                size = self._removal.store.size(blob)
                if size is not None and blob.startswith(blobs.of_job(job_id)):
                    self.sums += self._removal.remove([StoredBlob(blob, size)])

    def _continuing(self) -> defaultdict[str, list[str]]:
        """The jobs that continue each job."""
        continuing = defaultdict[str, list[str]](list)
        for job_id, continues in field_of_all(self._redis, "continues"):
            if continues is not None:
                continuing[continues].append(job_id)
        return continuing

    def _finished_for(self, older_than_ms: int) -> list[str]:
        """The jobs that finished this long ago, newest first."""
        before = now_ms(self._redis) - older_than_ms
        newest_first = reversed(list(field_of_all(self._redis, "finished_at")))
        return [
            job_id for job_id, at in newest_first if at is not None and int(float(at)) <= before
        ]

    def _deleted_for(self, older_than_ms: int) -> list[str]:
        """The finished jobs that were deleted this long ago, newest first."""
        before = now_ms(self._redis) - older_than_ms
        job_ids = self._redis.zrevrange(keys.DELETED, 0, -1)
        found = fields_of(self._redis, job_ids, ("deleted_at",), "sealed")
        deleted = [(one, had["deleted_at"]) for one, had in zip(job_ids, found, strict=True)]
        old = [one for one, at in deleted if at is not None and int(float(at)) <= before]
        ended = fields_of(self._redis, old, ("finished_at",))
        return [one for one, had in zip(old, ended, strict=True) if had["finished_at"] is not None]


def field_of_all(client: RedisClient, field: str) -> Iterator[tuple[str, str | None]]:
    """Yield the id of every job, the oldest first, with one of its fields as Redis has it."""
    ids = client.zrange(keys.JOBS, 0, -1)
    for start in range(0, len(ids), _PAGE):
        page = ids[start : start + _PAGE]
        found = fields_of(client, page, (field,))
        yield from ((job_id, had[field]) for job_id, had in zip(page, found, strict=True))
