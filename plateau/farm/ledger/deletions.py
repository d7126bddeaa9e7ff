"""Deletes and restores ended jobs, one by one or a whole batch of them."""

from collections.abc import Callable, Sequence

from plateau.farm.ledger.records import fields_of
from plateau.farm.model.batch import SteeredJob
from plateau.farm.model.errors import BatchNotFound, JobNotEnded, JobNotFound
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.jobs import Moved, SetDeleted
from plateau.farm.redis.scripts import OnRedis


class Deletions(OnRedis):
    """Which ended jobs are deleted. Every method raises `StoreUnavailable` when Redis is away.

    A deleted job keeps its records and results until a sweep removes it for good
    (`plateau.farm.sweep.finished_jobs`), as soon as no other job continues it.
    """

    def set(self, job_id: str, *, deleted: bool) -> None:
        """Delete the job, or restore it; repeating it is harmless.

        A deleted job leaves its batch, and joins it again when it is restored.

        Raises
        ------
        JobNotFound, JobNotEnded
            There is no such job, or it has not ended.
        """
        done = self._set(job_id, deleted=deleted)
        if done.outcome == "illegal":
            if done.state == "missing":
                raise JobNotFound(job_id)
            raise JobNotEnded(job_id, done.state)

    def set_batch(
        self, name: str, *, deleted: bool, may_touch: Callable[[str], bool] = lambda _: True
    ) -> list[SteeredJob]:
        """Delete each ended job of the batch, or restore those that were deleted from it.

        To repeat it is harmless. Jobs whose owner (an API key's id or "") `may_touch` refuses stay.

        Raises
        ------
        BatchNotFound
            There is no such batch.
        """
        job_ids = self._redis.zrange(keys.batch(name), 0, -1)
        if not deleted:
            job_ids += self._deleted_from(name)
        states = fields_of(self._redis, job_ids, ("state",))
        owners = fields_of(self._redis, job_ids, ("owner",), "sealed")
        if not job_ids:
            raise BatchNotFound(name)
        steered = []
        for job_id, had, owned in zip(job_ids, states, owners, strict=True):
            done, why_not, state = False, "it belongs to another API key", had["state"]
            if may_touch(owned["owner"] or ""):
                made = self._set(job_id, deleted=deleted)
                done = made.outcome == "changed"
                gone = made.state == "missing"
                why_not = "it was just forgotten" if gone else "it has not ended"
            steered.append(
                SteeredJob(
                    job=job_id,
                    done=done,
                    state=None if state is None else JobState(state),
                    why_not=None if done else why_not,
                )
            )
        return steered

    def _set(self, job_id: str, *, deleted: bool) -> Moved:
        return self._scripts.run(SetDeleted(job=job_id, deleted=deleted))

    def _deleted_from(self, batch: str) -> Sequence[str]:
        """The deleted jobs that were in the batch, by their number of creation."""
        job_ids = self._redis.zrange(keys.DELETED, 0, -1)
        found = fields_of(self._redis, job_ids, ("batch",))
        return [job for job, had in zip(job_ids, found, strict=True) if had["batch"] == batch]
