"""Jobs as the monitor sees them: own one, plan its slices, extend its curve, end it.

A job has one owner at a time: a lease in Redis with a fencing token. Every write below carries
the token and is refused, with `FenceLost`, once another monitor has taken over.
"""

import json
from dataclasses import dataclass

import redis

from farm import keys
from farm.errors import FenceLost, IllegalTransition
from farm.queue import SliceRecord
from farm.redis_link import unavailable_as_farm_error
from farm.scripts import Scripts
from farm.states import JobState


@dataclass(frozen=True)
class Ownership:
    """A job and the token under which this monitor owns it."""

    job_id: str
    token: str


class Ownerships:
    """What a monitor may do with jobs. Methods raise `StoreUnavailable` and `FenceLost`."""

    def __init__(self, client: redis.Redis, lease_s: float) -> None:
        self._redis = client
        self._scripts = Scripts(client)
        self._lease_ms = round(lease_s * 1000)

    def unfinished(self) -> set[str]:
        """The jobs that a monitor still has work with."""
        with unavailable_as_farm_error():
            return set(self._redis.smembers(keys.UNFINISHED))

    def acquire(self, job_id: str) -> Ownership | None:
        """Own the job, unless another monitor does."""
        token = self._scripts.run("own", job_id, self._lease_ms)
        return Ownership(job_id, token) if token else None

    def renew(self, owned: tuple[Ownership, ...]) -> set[str]:
        """Keep owning these jobs; returns those that were lost."""
        return set(self._scripts.run("renew", self._lease_ms, *_flat(owned)))

    def disown(self, owned: tuple[Ownership, ...]) -> None:
        """Give the jobs to whichever monitor comes next."""
        self._scripts.run("disown", *_flat(owned))

    def committed(self, job_id: str, indices: range) -> list[SliceRecord]:
        """The ledger's records from the first index on, up to the first that is missing."""
        if not indices:
            return []
        with unavailable_as_farm_error():
            texts = self._redis.hmget(keys.job(job_id, "ledger"), [str(i) for i in indices])
        records = []
        for text in texts:
            if text is None:
                break
            records.append(SliceRecord.model_validate_json(text))
        return records

    def checkpoint(self, job_id: str) -> str | None:
        """The blob of the job's last checkpoint, if it has one."""
        with unavailable_as_farm_error():
            name: str | None = self._redis.hget(keys.job(job_id), "checkpoint")
        return name

    def plan(self, owned: Ownership, slices: range) -> None:
        """Put these slices into the job's stream; those already planned are left alone."""
        self._checked("plan", owned, slices.start, slices.stop)

    def append_point(self, owned: Ownership, spp: int, point: dict[str, object]) -> None:
        """Append a point to the curve, once for each spp."""
        self._checked("append_point", owned, spp, json.dumps(point))

    def save(self, owned: Ownership, **fields: str | int) -> None:
        """Set fields of the job."""
        self._checked("save", owned, *(item for pair in fields.items() for item in pair))

    def end(
        self,
        owned: Ownership,
        target: JobState,
        reason: str,
        verdict: dict[str, float | None] | None = None,
    ) -> None:
        """End the job; its remaining slices are withdrawn.

        Raises
        ------
        IllegalTransition
            The job has ended otherwise in the meantime: it was cancelled, or it failed.
        """
        outcome, *state = self._scripts.run(
            "end",
            owned.job_id,
            owned.token,
            target,
            reason,
            "" if verdict is None else json.dumps(verdict),
        )
        if outcome == "fenced":
            raise FenceLost(owned.job_id)
        if outcome == "illegal":
            raise IllegalTransition(owned.job_id, state[0], target)

    def finish(self, owned: Ownership, **fields: str | int) -> None:
        """Say that the job's results are written; no monitor has work with it any more."""
        self._checked("finish", owned, *(item for pair in fields.items() for item in pair))

    def _checked(self, script: str, owned: Ownership, *arguments: str | int) -> None:
        if self._scripts.run(script, owned.job_id, owned.token, *arguments) == "fenced":
            raise FenceLost(owned.job_id)


def _flat(owned: tuple[Ownership, ...]) -> list[str]:
    return [item for one in owned for item in (one.job_id, one.token)]
