"""Jobs in Redis: creating, listing and steering them."""

from dataclasses import dataclass
from typing import Any

from plateau.farm.ledger import records
from plateau.farm.ledger.job_reads import JobReads
from plateau.farm.ledger.listing import Filter, jobs_before
from plateau.farm.model.errors import (
    CannotFollow,
    IllegalTransition,
    JobEnded,
    JobNotFound,
    TooManyJobs,
    TooManyNeeds,
)
from plateau.farm.model.job import Again, Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.commands.jobs import (
    Create,
    End,
    Made,
    Moved,
    Pause,
    Reprioritise,
    Resume,
)
from plateau.farm.redis.link import now_ms


@dataclass(frozen=True, kw_only=True)
class Created:
    """The answer to a request to create a job."""

    job: Job
    repeated: bool  #: the idempotency key was known: an earlier request made this job
    conflict: bool  #: the key was known for another request


def request_key(idempotency_key: str, owner: str) -> str:
    """The idempotency key as Redis has it: each owner has their own keys."""
    return f"{owner}:{idempotency_key}" if owner and idempotency_key else idempotency_key


class Jobs(JobReads):
    """All jobs. Every method raises `StoreUnavailable` when Redis is away."""

    def create(
        self,
        *specs: JobSpec,
        name: str,
        scene_sha256: str,
        idempotency_key: str = "",
        digest: str = "",
        owner: str = "",
        notes: tuple[str, ...] = (),
        again: Again | None = None,
    ) -> Created:
        """Create a job for each spec, `queued`, all or none; returns the first one.

        The same idempotency key of the same owner creates them once. The specs differ only in their
        parameters; `notes` say what of them was changed.

        Raises
        ------
        TooManyJobs
            Its owner, an API key's id, has as many open jobs as it may.
        TooManyNeeds
            It needs another pool or other tags than all open jobs, whose needs are many already.
        CannotFollow
            A job or batch of `spec.after` is unknown, or has not ended well.
        """
        jobs = tuple(
            records.new_job(
                spec, name=name, scene_sha256=scene_sha256, owner=owner, notes=notes, again=again
            )
            for spec in specs
        )
        if specs[0].shot is not None:
            jobs = records.as_shot(jobs)
        made = self._scripts.run(
            Create(
                idempotency=request_key(idempotency_key, owner),
                digest=digest,
                priority=specs[0].priority,
                jobs=jobs,
                after=specs[0].after,
            )
        )
        return self.created(made)

    def created(self, made: Made) -> Created:
        """The script's answer to a request for new jobs; raises as `create` does."""
        if made.outcome == "too many":
            raise TooManyJobs(made.has, made.most)
        if made.outcome == "too varied":
            raise TooManyNeeds(made.has)
        if made.outcome == "cannot follow":
            raise CannotFollow(made.after, made.state)
        return Created(
            job=self.get(made.job),
            repeated=made.outcome == "repeated",
            conflict=made.outcome == "conflict",
        )

    def get(self, job_id: str) -> Job:
        """The job, or `JobNotFound`; or `UnreadableJob`, as from all methods that return a job."""
        pipe = self._redis.pipeline(transaction=False)
        records.ask_for(pipe, job_id)
        fields, sealed = pipe.execute()
        if not fields:
            raise JobNotFound(job_id)
        return records.job(job_id, fields, sealed)

    def search(
        self, *, before: int | None = None, limit: int = 50, **wanted: Any
    ) -> tuple[list[Job], int | None]:
        """A page of the jobs that a `Filter` of these fields wants; see `jobs_before`."""
        return jobs_before(self._redis, Filter(**wanted), before=before, limit=limit)

    def cancel(self, job_id: str, reason: str = "cancelled by a user") -> Job:
        """Cancel the job; cancelling it again is harmless.

        Raises
        ------
        JobNotFound
            There is no such job.
        IllegalTransition
            It has already ended otherwise.
        """
        target = JobState.CANCELLED
        return self._move(
            target, job_id, End(job=job_id, target=target, ended_by="person", reason=reason)
        )

    def pause(self, job_id: str, reason: str = "paused by a user") -> Job:
        """Pause the job: none of its slices is leased any more; pausing it again is harmless.

        Slices that are being rendered are still committed, merged and judged, so the job may yet
        converge or reach its cap. Its time limit stands still.

        Raises
        ------
        JobNotFound, IllegalTransition
            There is no such job, or it is not rendering.
        """
        return self._move(JobState.PAUSED, job_id, Pause(job=job_id, reason=reason))

    def resume(self, job_id: str, reason: str = "resumed by a user") -> Job:
        """Resume a paused job; resuming one that is rendering is harmless.

        Raises
        ------
        JobNotFound, IllegalTransition
            There is no such job, or it is not paused.
        """
        return self._move(JobState.RENDERING, job_id, Resume(job=job_id, reason=reason))

    def set_priority(self, job_id: str, priority: int) -> Job:
        """Give the job another priority, which the next lease respects.

        Raises
        ------
        JobNotFound, JobEnded
            There is no such job, or it has ended.
        """
        moved = self._scripts.run(Reprioritise(job=job_id, priority=priority))
        if moved.outcome == "illegal":
            if moved.state == "missing":
                raise JobNotFound(job_id)
            raise JobEnded(job_id, moved.state, self.story(job_id))
        return self.get(job_id)

    def places(self) -> dict[str, int]:
        """The place of each queued job, from 1: by priority, then by age.

        Within a priority, keys and batches share the workers, so that older jobs may start later.
        """
        weights = {keys.OPEN: -1e12, keys.in_state(JobState.QUEUED.value): 1}
        return {job: place for place, job in enumerate(self._redis.zinter(weights), start=1)}

    def now_ms(self) -> int:
        """Redis's clock in milliseconds, which all processes go by."""
        return now_ms(self._redis)

    def _move(self, target: JobState, job_id: str, command: Command[Moved]) -> Job:
        """Run a user's command that moves the job, and return the job."""
        moved = self._scripts.run(command)
        if moved.outcome == "illegal":
            if moved.state == "missing":
                raise JobNotFound(job_id)
            raise IllegalTransition(job_id, moved.state, target.value, self.story(job_id))
        return self.get(job_id)
