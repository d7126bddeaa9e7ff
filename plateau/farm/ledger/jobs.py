"""Jobs in Redis: creating, reading, listing and steering them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from plateau.farm.blobs import store as blobs
from plateau.farm.ledger import records
from plateau.farm.ledger.listing import Filter, jobs_before
from plateau.farm.ledger.ownership import Checkpoint, checkpoint_of
from plateau.farm.ledger.slice_log import slice_log
from plateau.farm.ledger.totals import Census, take_census
from plateau.farm.ledger.usage import usage
from plateau.farm.ledger.workers import ALIVE_S
from plateau.farm.model.errors import (
    CannotFollow,
    IllegalTransition,
    JobEnded,
    JobNotFound,
    TooManyJobs,
    TooManyNeeds,
)
from plateau.farm.model.job import BEFORE_ALL_EVENTS, Again, CurvePoint, Event, Job, LogEntry
from plateau.farm.model.slices.plan import Plan
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.model.usage import Grouping, Spent
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
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
from plateau.farm.redis.link import now_ms, unavailable_as_farm_error
from plateau.farm.redis.scripts import Scripts


@dataclass(frozen=True, kw_only=True)
class Created:
    """The answer to a request to create a job."""

    job: Job
    repeated: bool  #: the idempotency key was known: an earlier request made this job
    conflict: bool  #: the key was known for another request


def request_key(idempotency_key: str, owner: str) -> str:
    """The idempotency key as Redis has it: each owner has their own keys."""
    return f"{owner}:{idempotency_key}" if owner and idempotency_key else idempotency_key


class Jobs:
    """All jobs. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        self._redis = client
        self._scripts = Scripts(client)

    def create(
        self,
        spec: JobSpec,
        *,
        name: str,
        scene_sha256: str,
        idempotency_key: str = "",
        digest: str = "",
        owner: str = "",
    ) -> Created:
        """Create a job, `queued`; the same idempotency key of the same owner creates it once.

        Raises
        ------
        TooManyJobs
            Its owner, an API key's id, has as many open jobs as it may.
        TooManyNeeds
            It needs another pool or other tags than all open jobs, whose needs are many already.
        CannotFollow
            A job or batch of `spec.after` is unknown, or has not ended well.
        """
        return self.create_all(
            [spec],
            name=name,
            scene_sha256=scene_sha256,
            idempotency_key=idempotency_key,
            digest=digest,
            owner=owner,
        )

    def create_all(
        self,
        specs: list[JobSpec],
        *,
        name: str,
        scene_sha256: str,
        idempotency_key: str = "",
        digest: str = "",
        owner: str = "",
        notes: tuple[str, ...] = (),
        again: Again | None = None,
    ) -> Created:
        """As `create`, for each spec, all or none; returns the first job.

        The specs differ only in their parameters; `notes` say what of them was changed.
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
        with unavailable_as_farm_error():
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

    def usage(
        self, by: Grouping, *, since: datetime | None, until: datetime | None, limit: int
    ) -> tuple[list[Spent], int, Spent]:
        """What jobs have cost; see `plateau.farm.ledger.usage.usage`."""
        return usage(self._redis, by, since=since, until=until, limit=limit)

    def curve(self, job_id: str) -> list[CurvePoint]:
        """The points of the job's curve, by rising spp."""
        with unavailable_as_farm_error():
            entries = self._redis.xrange(keys.job(job_id, "curve"))
        return [records.curve_point(fields["point"], fields["at"]) for _, fields in entries]

    def events(self, job_id: str, after: str = BEFORE_ALL_EVENTS) -> list[Event]:
        """The job's events after the event `after`."""
        with unavailable_as_farm_error():
            entries = self._redis.xrange(keys.job(job_id, "events"), min=f"({after}")
        return [records.event(event_id, fields) for event_id, fields in entries]

    def story(self, job_id: str) -> tuple[str, ...]:
        """Each transition of the job in words, with its time and its cause."""
        return tuple(
            f"{happening.at:%Y-%m-%d %H:%M:%S} {happening.data['to']}: {happening.data['reason']}"
            for happening in self.events(job_id)
            if happening.type == "state"
        )

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

    def results(self, job_id: str) -> str:
        """The blob prefix of the job's last results; "" where it has none yet."""
        with unavailable_as_farm_error():
            return self._redis.hget(keys.job(job_id), "results") or ""

    def sha256(self, blob: str) -> str | None:
        """The SHA-256 of a job's result or preview; None where the blob went."""
        job_id, name = blobs.in_job(blob)
        with unavailable_as_farm_error():
            sha256: str | None = self._redis.hget(keys.job(job_id, "digests"), name)
        return sha256

    def checkpoint(self, job_id: str) -> Checkpoint | None:
        """The job's last checkpoint, if it is kept."""
        return checkpoint_of(self._redis, job_id)

    def plan(self, job: Job) -> Plan:
        """What each slice of the job has, as far as it is decided."""
        stored: list[str] = []
        if job.spec.by_zones:
            with unavailable_as_farm_error():
                stored = self._redis.zrange(keys.job(job.id, "rounds"), 0, -1)
        has_looks = job.spec.is_denoised and not job.spec.by_zones
        points = self.curve(job.id) if has_looks else []
        return Plan.of(
            job.spec,
            job.width,
            job.height,
            map(Round.from_json, stored),
            [(point.spp, point.expected_spp) for point in points],
        )

    def ledger(self, job_id: str) -> dict[int, dict[str, Any]]:
        """Each committed slice's record, by index, in order."""
        with unavailable_as_farm_error():
            return records.ledger(self._redis.hgetall(keys.job(job_id, "ledger")))

    def log(self, job_id: str, index: int | None = None) -> list[LogEntry]:
        """How each try of a slice ended, or of this one; the newest 2000 or so that were noted."""
        with unavailable_as_farm_error():
            pipe = self._redis.pipeline(transaction=True)
            pipe.xrange(keys.job(job_id, "log"))
            pipe.hgetall(keys.job(job_id, "ledger"))
            entries, committed = pipe.execute()
        wanted = None if index is None else str(index)
        written = (one for _, one in entries if wanted in {None, one["slice"]})
        ledger = {at: one for at, one in committed.items() if wanted in {None, at}}
        return slice_log(written, records.ledger(ledger))

    def workers(self, within_s: float = ALIVE_S) -> list[Worker]:
        """The workers that sent a heartbeat in the last `within_s` seconds."""
        with unavailable_as_farm_error():
            now = self.now_ms()
            alive = self._redis.zrangebyscore(keys.WORKERS, now - within_s * 1000, "+inf")
            pipe = self._redis.pipeline(transaction=False)
            for worker_id in alive:
                pipe.hgetall(keys.worker(worker_id))
            return [records.worker(fields, now) for fields in pipe.execute() if fields]

    def places(self) -> dict[str, int]:
        """The place of each queued job, from 1: by priority, then by age.

        Within a priority, keys and batches share the workers, so that a job may start before older
        ones of others.
        """
        with unavailable_as_farm_error():
            weights = {keys.OPEN: -1e12, keys.in_state(JobState.QUEUED.value): 1}
            return {job: place for place, job in enumerate(self._redis.zinter(weights), start=1)}

    def now_ms(self) -> int:
        """Redis's clock in milliseconds, which all processes go by."""
        return now_ms(self._redis)

    def census(self, *, from_priority: int | None = None) -> Census:
        """The whole farm's work, done and to do; demand counts jobs of this priority or above."""
        return take_census(self._scripts, from_priority=from_priority)

    def ping(self) -> None:
        """Return if Redis answers; raise `StoreUnavailable` otherwise."""
        with unavailable_as_farm_error():
            self._redis.ping()

    def _move(self, target: JobState, job_id: str, command: Command[Moved]) -> Job:
        """Run a user's command that moves the job, and return the job."""
        moved = self._scripts.run(command)
        if moved.outcome == "illegal":
            if moved.state == "missing":
                raise JobNotFound(job_id)
            raise IllegalTransition(job_id, moved.state, target.value, self.story(job_id))
        return self.get(job_id)
