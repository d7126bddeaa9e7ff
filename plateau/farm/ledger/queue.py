"""A worker's side of the queue: lease a slice, keep the lease, commit it or give it back."""

import json
from dataclasses import dataclass
from typing import Any

from plateau.farm.ledger.workers import ALIVE_S
from plateau.farm.model.errors import UnreadableJob
from plateau.farm.model.fit import WorkerClass
from plateau.farm.model.place_names import DEFAULT_POOL
from plateau.farm.model.record import Record
from plateau.farm.model.slices.rounds import Round
from plateau.farm.model.spec import JobSpec, stored_spec
from plateau.farm.model.states import MAX_TRIES
from plateau.farm.redis import keys
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands import slices as commands
from plateau.farm.redis.commands.members import Heartbeat, LeaseName, Leave
from plateau.farm.redis.commands.slices import (
    Commit,
    CommitEnd,
    Died,
    Fail,
    Glimpse,
    HandBack,
    LeasedSlice,
    Offer,
)
from plateau.farm.redis.scripts import OnRedis


@dataclass(frozen=True, kw_only=True)
class Lease:
    """One slice, this worker's until it commits it, gives it back, or stops renewing the lease."""

    job_id: str
    entry: str  #: the entry of the job's stream
    index: int
    tries: int  #: the number of leases of the slice, this one included
    variant: str
    spec: JobSpec
    scene_sha256: str
    round: Round | None = None  #: the slice's zones and spp, unless it is of the whole film

    @property
    def spp(self) -> int:
        """Samples per pixel of the slice."""
        return self.spec.slice_spp if self.round is None else self.round.spp


class SliceRecord(Record):
    """A slice's record in the ledger."""

    index: int
    spp: int
    first_seed: int
    last_seed: int
    blob: str  #: the partial's name in the blob store
    sha256: str  #: of the partial's bytes
    worker: str
    render_s: float


class SliceQueue(OnRedis):
    """The slices of all jobs, for one worker. Methods raise `StoreUnavailable`.

    Parameters
    ----------
    client, worker_id
        Redis, and who asks.
    lease_s
        A lease that is not renewed for this long may be taken from its worker.
    pool, tags
        The worker takes only jobs of this pool that require no other tags.
    threads
        On how many its render child runs, for the job's core hours.
    """

    def __init__(
        self,
        client: RedisClient,
        worker_id: str,
        lease_s: float,
        *,
        pool: str = DEFAULT_POOL,
        tags: tuple[str, ...] = (),
        threads: int = 1,
    ) -> None:
        super().__init__(client)
        self._worker = worker_id
        self._lease_ms = round(lease_s * 1000)
        self._pool, self._tags = pool, tags
        self._threads = threads
        #: After `lease` found nothing: seconds until it may, without a message from Redis. By then
        #: another worker's slice may be late.
        self.look_again_s = float("inf")

    def lease(
        self, variants: tuple[str, ...], loaded_job: str | None, *, in_turn: bool
    ) -> Lease | None:
        """The next slice for this worker, or None where there is nothing to do.

        `variants` are those it can render, best first; `in_turn` keeps to the job that is loaded.

        Raises
        ------
        UnreadableJob
            Its spec cannot be read here; this worker takes nothing of the job for a while.
        """
        offer = Offer(again=True)
        while offer.again:
            offer = self._scripts.run(
                commands.Lease(
                    worker=self._worker,
                    kind=WorkerClass(variants, self._pool, self._tags).text,
                    loaded=loaded_job or "",
                    in_turn=in_turn,
                    lease_ms=self._lease_ms,
                    most_tries=MAX_TRIES,
                )
            )
        found = offer.slice
        if found is None:
            self.look_again_s = float("inf") if offer.wait_ms is None else offer.wait_ms / 1000
            return None
        try:
            spec = stored_spec(found.spec).settled(found.variant)
        except ValueError as error:  # such as of a rule that is not installed here
            cause = str(UnreadableJob(found.job, error))
            self.hand_back(found, cause=cause, leaves_out=True)
            raise UnreadableJob(found.job, error) from error
        return Lease(
            job_id=found.job,
            entry=found.entry,
            index=found.index,
            tries=found.tries,
            variant=found.variant,
            spec=spec,
            scene_sha256=found.scene,
            round=None if found.round is None else Round.from_json(found.round),
        )

    def glimpse(self, lease: Lease, blob: str) -> bool:
        """Report the blob of the first pass of a job's first slice, a partial of its own.

        Returns False where nobody needs it: the lease is lost, or the job has an image already.
        """
        answer = self._scripts.run(
            Glimpse(job=lease.job_id, entry=lease.entry, worker=self._worker, blob=blob)
        )
        return answer == "noted"

    def commit(
        self,
        lease: Lease,
        record: SliceRecord,
        *,
        width: int,
        height: int,
        notes: tuple[str, ...],
        said: str = "",
    ) -> CommitEnd:
        """Enter the slice into the ledger, once; safe to repeat.

        The first commit of a slice counts, even after its lease ran out. As in the other reports,
        `said` is the render child's output, for the job's log.
        """
        return self._scripts.run(
            Commit(
                **self._of_try(lease, record.render_s, said),
                record=record.model_dump_json(),
                width=width,
                height=height,
                notes=json.dumps(notes),
                variant=lease.variant,
            )
        )

    def died(self, lease: Lease, cause: str, machine_s: float, said: str = "") -> str:
        """Report that the render child died on the slice; the third death fails the job.

        If another worker can render the job, this one takes nothing of it for a while.
        """
        return self._scripts.run(
            Died(
                **self._of_try(lease, machine_s, said),
                cause=cause,
                most_tries=MAX_TRIES,
                alive_ms=round(ALIVE_S * 1000),
            )
        )

    def hand_back(
        self,
        lease: Lease | LeasedSlice,
        machine_s: float = 0.0,
        *,
        cause: str = "",
        unfit: bool = False,
        leaves_out: bool = False,
        said: str = "",
    ) -> None:
        """Give the slice back for the next worker.

        This one is `unfit` if it can render nothing. With `leaves_out` it takes nothing of this job
        for a while, and renders others.
        """
        self._scripts.run(
            HandBack(
                **self._of_try(lease, machine_s, said),
                what="unfit" if unfit else "handed-back",
                cause=cause,
                leaves_out=leaves_out,
            )
        )

    def fail(self, lease: Lease, reason: str, machine_s: float = 0.0, said: str = "") -> None:
        """Fail the job: no worker can render its scene."""
        self._scripts.run(
            Fail(
                **self._of_try(lease, machine_s, said),
                reason=reason,
            )
        )

    def _of_try(self, lease: Lease | LeasedSlice, machine_s: float, said: str) -> dict[str, Any]:
        """The fields that all `TryCommand` have, of the try that ends."""
        return {
            "job": lease.job_id if isinstance(lease, Lease) else lease.job,
            "entry": lease.entry,
            "worker": self._worker,
            "index": lease.index,
            "machine_ms": round(machine_s * 1000),
            "threads": self._threads,
            "said": said,
        }

    def heartbeat(self, about: dict[str, object], leases: tuple[Lease, ...]) -> tuple[Lease, ...]:
        """Report that the worker lives, and renew its leases; returns the lost ones."""
        held = {LeaseName(lease.job_id, lease.entry): lease for lease in leases}
        lost = self._scripts.run(
            Heartbeat(
                worker=self._worker,
                about=json.dumps(about),
                lease_ms=self._lease_ms,
                leases=tuple(held),
            )
        )
        return tuple(held[name] for name in lost)

    def leave(self) -> None:
        """Sign off."""
        self._scripts.run(Leave(worker=self._worker))

    def ended(self, job_id: str) -> bool:
        """Whether the job has ended, or is unknown."""
        return self._redis.zscore(keys.OPEN, job_id) is None
