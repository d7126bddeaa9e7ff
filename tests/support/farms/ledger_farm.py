"""Jobs and workers over one Redis, for tests of the ledger that wait for no clock."""

from typing import Any

import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownership, Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys
from tests.support import FRAMES

LEASE_S = 60.0
VARIANTS = ("llvm_ad_rgb", "scalar_rgb")


class LedgerFarm:
    """One Redis, one monitor's ownerships and any number of workers."""

    def __init__(self, client: redis.Redis) -> None:
        self.client = client
        self.jobs = Jobs(client)
        self.owners = Ownerships(client, lease_s=LEASE_S)

    def worker(self, name: str = "w", **more: Any) -> SliceQueue:
        return SliceQueue(self.client, name, LEASE_S, **more)

    def job(self, slices: int = 4, owner: str = "", **spec: object) -> tuple[Job, Ownership]:
        made = self.jobs.create(
            JobSpec(**FRAMES | spec), name="box", scene_sha256="00", owner=owner
        )
        owned = own(self.owners, made.job.id)
        self.owners.plan(owned, range(slices))
        return made.job, owned

    def runs_out(self, held: Lease) -> None:
        runs_out(self.client, held)


def runs_out(client: redis.Redis, held: Lease) -> None:
    """The lease has lasted for its time, and nothing was heard of its worker meanwhile."""
    slices, member = keys.job(held.job_id, "slices"), f"{held.job_id} {held.entry}"
    at = client.xpending_range(slices, keys.GROUP, held.entry, held.entry, 1)[0]["consumer"]
    client.xclaim(slices, keys.GROUP, at, 0, [held.entry], idle=10**9, justid=True)
    client.zadd(keys.LEASES, {member: 1}, xx=True)
    client.zadd(keys.WORKERS, {at: 1}, xx=True)


def live_on(client: redis.Redis, *workers: str) -> None:
    """The workers were heard in the future, so that no stall makes them dead."""
    client.zadd(keys.WORKERS, dict.fromkeys(workers, 9e15))


def own(owners: Ownerships, job_id: str) -> Ownership:
    """The job becomes this monitor's: it is no other's."""
    owned = owners.acquire(job_id)
    assert owned is not None
    return owned


def lease(
    worker: SliceQueue,
    loaded: str | None = None,
    *,
    in_turn: bool = False,
    variants: tuple[str, ...] = VARIANTS,
) -> Lease:
    """The slice that the worker is given: there is one."""
    found = worker.lease(variants, loaded, in_turn=in_turn)
    assert found is not None
    return found


def lease_scalar(worker: SliceQueue) -> Lease:
    """The slice that a worker without LLVM is given."""
    return lease(worker, variants=("scalar_rgb",))


def record_of(held: Lease, seeds: tuple[int, int] | None = None, **other: object) -> SliceRecord:
    """What a worker commits of the slice: of these seeds, both ends included, if it matters."""
    first, last = seeds or (10 * held.index, 10 * held.index + 2)
    known = {
        "index": held.index,
        "spp": held.spec.slice_spp,
        "first_seed": first,
        "last_seed": last,
        "blob": f"partial-{held.index}",
        "sha256": "00",
        "worker": "w",
        "render_s": 1.5,
    }
    return SliceRecord.model_validate({**known, **other})


def commit(queue: SliceQueue, held: Lease, *, said: str = "", **record: Any) -> str:
    made = record_of(held, **record)
    return queue.commit(held, made, width=8, height=4, notes=("a note",), said=said)


def about(name: str) -> dict[str, object]:
    """What a worker of this name says of itself."""
    return {
        "id": name,
        "host": "here",
        "pid": 1,
        "variants": ("scalar_rgb",),
        "threads": 1,
        "job": None,
        "slice": None,
        "slices_done": 0,
        "samples_per_s": None,
        "last_error": None,
        "started_at": "2026-11-21T08:00:00Z",
    }
