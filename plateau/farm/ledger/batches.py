"""Batches in Redis: listed, summed up, and steered as one.

A batch exists from the first job of its name until the last is forgotten.
"""

import json
from collections import Counter
from collections.abc import Callable
from enum import Enum
from typing import Final

from plateau.farm.ledger import costs, records
from plateau.farm.ledger.shots import ShotRecord, Shots, summary
from plateau.farm.model.batch import Batch, BatchLine, Member, SteeredJob, summarise
from plateau.farm.model.errors import BatchNotFound
from plateau.farm.model.job import moment
from plateau.farm.model.shot import Shot
from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.commands.jobs import End, Moved, Outcome, Pause, Resume
from plateau.farm.redis.scripts import OnRedis

#: Jobs that are read, or moved, in one round trip.
_AT_ONCE: Final = 250

#: The fields of a job's hash that a summary needs.
_FIELDS: Final = (
    *("state", "spec", "spp", "committed", "committed_samples", "slice_spp", "machine_ms"),
    *("latest", "shot"),
    *("created_at", "started_at", "ended_at", "finished_at", "held", "samples_saved"),
)


class Steer(Enum):
    """A change to all jobs of a batch at once."""

    CANCEL = "cancel"
    PAUSE = "pause"
    RESUME = "resume"


class Batches(OnRedis):
    """All batches. Every method raises `StoreUnavailable` when Redis is away."""

    def __init__(self, client: RedisClient) -> None:
        super().__init__(client)
        self.shots = Shots(client)

    def page(
        self, *, before: int | None = None, limit: int = 20
    ) -> tuple[list[BatchLine], int | None]:
        """Batches by their newest jobs, below the number `before`, and the next page's number."""
        highest = "+inf" if before is None else f"({before}"
        rows = self._redis.zrevrangebyscore(
            keys.BATCHES, highest, "-inf", start=0, num=limit, withscores=True
        )
        lines = (self._line(name) for name, _ in rows)
        found = [line for line in lines if line is not None]
        return found, int(rows[-1][1]) if len(rows) == limit else None

    def _line(self, name: str) -> BatchLine | None:
        """The batch in a list; jobs whose state is lost or unknown do not count."""
        job_ids, names = self._redis.zrange(keys.batch(name), 0, -1), ("state", "created_at")
        found = (one.values() for one in records.fields_of(self._redis, job_ids, names))
        known = {state.value for state in JobState}
        jobs = [(state, at) for state, at in found if state in known and at is not None]
        if not jobs:
            return None
        return BatchLine(
            name=name,
            jobs=len(jobs),
            states=Counter(JobState(state) for state, _ in jobs),
            newest_at=moment(jobs[-1][1]),
        )

    def get(self, name: str) -> Batch:
        """A summary of the batch's jobs, or `BatchNotFound`."""
        pipe = self._redis.pipeline(transaction=True)
        pipe.zrange(keys.batch(name), 0, -1)
        pipe.time()
        job_ids, (seconds, microseconds) = pipe.execute()
        members = self._members(job_ids)
        if not members:
            raise BatchNotFound(name)
        now = moment(int(seconds) * 1000 + int(microseconds) / 1000)
        return summarise(name, members, now=now, shot=self._newest_shot(members))

    def shot(self, name: str) -> ShotRecord | None:
        """The newest shot of the batch, or None where it has none; `BatchNotFound` without it."""
        job_ids = self._redis.zrevrange(keys.batch(name), 0, -1)
        shots = (one["shot"] for one in records.fields_of(self._redis, job_ids, ("shot",)))
        found = next(filter(None, shots), None)
        if not job_ids:
            raise BatchNotFound(name)
        return None if found is None else self.shots.get(found)

    def _newest_shot(self, members: list[Member]) -> Shot | None:
        found = next((one.shot for one in reversed(members) if one.shot is not None), None)
        record = None if found is None else self.shots.get(found)
        return None if record is None else summary(record)

    def steer(
        self,
        name: str,
        steer: Steer,
        *,
        by: str = "a user",
        may_touch: Callable[[str], bool] = lambda _: True,
    ) -> list[SteeredJob]:
        """Cancel, pause or resume each job of the batch; repeating it is harmless.

        A pause also holds back queued jobs. Jobs whose owner (an API key's id, or "") `may_touch`
        refuses are left alone. `by` is for the jobs' stories.

        Raises
        ------
        BatchNotFound
            There is no such batch.
        """
        job_ids = self._redis.zrange(keys.batch(name), 0, -1)
        owners = records.fields_of(self._redis, job_ids, ("owner",), "sealed")
        if not job_ids:
            raise BatchNotFound(name)
        owned = zip(job_ids, owners, strict=True)
        mine = [job_id for job_id, had in owned if may_touch(had["owner"] or "")]
        answers: dict[str, Moved] = {}
        for start in range(0, len(mine), _AT_ONCE):
            some = mine[start : start + _AT_ONCE]
            moves = [_move(steer, job_id, by) for job_id in some]
            answers |= zip(some, self._scripts.run_each(moves), strict=True)
        return [_steered(job_id, steer, answers.get(job_id)) for job_id in job_ids]

    def _members(self, job_ids: list[str]) -> list[Member]:
        members = []
        for start in range(0, len(job_ids), _AT_ONCE):
            some = job_ids[start : start + _AT_ONCE]
            found = records.fields_of(self._redis, some, _FIELDS)
            for job_id, fields in zip(some, found, strict=True):
                if fields[_FIELDS[0]] is None:  # forgotten a moment ago
                    continue
                with records.leaving_out_unreadable(), records.reading(job_id):
                    members.append(_member(job_id, fields))
        return members


def _move(steer: Steer, job_id: str, by: str) -> Command[Moved]:
    if steer is Steer.CANCEL:
        reason = f"cancelled with its batch by {by}"
        return End(job=job_id, target=JobState.CANCELLED, ended_by="person", reason=reason)
    if steer is Steer.PAUSE:
        return Pause(job=job_id, reason=f"paused with its batch by {by}", holds_back=True)
    return Resume(job=job_id, reason=f"resumed with its batch by {by}")


#: The state of a job after its move.
_THEN: Final[dict[Outcome, JobState]] = {
    "ended": JobState.CANCELLED,
    "paused": JobState.PAUSED,
    "held": JobState.QUEUED,
    "rendering": JobState.RENDERING,
    "queued": JobState.QUEUED,
}


def _steered(job_id: str, steer: Steer, answer: Moved | None) -> SteeredJob:
    if answer is None:
        return SteeredJob(
            job=job_id, done=False, state=None, why_not="it belongs to another API key"
        )
    if answer.outcome in _THEN:
        return SteeredJob(job=job_id, done=True, state=_THEN[answer.outcome])
    if answer.state == "missing":
        return SteeredJob(job=job_id, done=False, why_not="it was just forgotten")
    found = JobState(answer.state)
    done = steer is Steer.RESUME and found is JobState.QUEUED  # nothing holds it back
    return SteeredJob(job=job_id, done=done, state=found, why_not=None if done else "it has ended")


def _member(job_id: str, fields: dict[str, str | None]) -> Member:
    latest = json.loads(fields["latest"] or "{}")
    times = {
        name: moment(at) if (at := fields[name]) is not None else None
        for name in ("started_at", "ended_at")
    }
    return Member(
        id=job_id,
        spec=_shared_spec(fields["spec"] or ""),
        state=JobState(fields["state"] or ""),
        held=fields["held"] is not None and fields["state"] == JobState.QUEUED,
        spp=int(fields["spp"] or 0),
        committed_spp=costs.committed_spp(fields, int(fields["slice_spp"] or 0)),
        estimate_fraction=latest.get("estimate_fraction"),
        expected_spp=latest.get("expected_spp"),
        shot=fields["shot"],
        machine_s=int(fields["machine_ms"] or 0) / 1000,
        samples_saved=int(fields["samples_saved"] or 0),
        created_at=moment(fields["created_at"] or 0),
        finished=fields["finished_at"] is not None,
        **times,
    )


def _shared_spec(text: str) -> JobSpec:
    """The spec without what differs between the jobs of a batch, so that it is read once."""
    return stored_spec(json.dumps({**json.loads(text), "parameters": {}, "frame_seed": 0}))
