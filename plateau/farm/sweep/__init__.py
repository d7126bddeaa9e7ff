"""Removes old jobs, unused scenes, and blobs that nothing refers to.

A sweep may be killed at any point and run beside another: it removes the records of a job or a
scene first, in one atomic command, and its blobs afterwards. A killed sweep leaves blobs that
nothing refers to, for the next one. `finished_jobs`, `orphans` and `scenes` explain why nothing
goes that is needed.

A Redis that lost its data, or the wrong one, knows none of the jobs, and all results would be
orphans. So nothing is removed unless by `plateau.farm.ledger.pairing` the two belong together.
"""

from dataclasses import dataclass
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.sweeps import BeginSweep
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep.finished_jobs import FinishedJobs
from plateau.farm.sweep.orphans import remove_orphans
from plateau.farm.sweep.removal import Removal
from plateau.farm.sweep.scenes import remove_scenes

__all__ = ["Swept", "in_seconds", "is_due", "sweep"]

_DAY_S: Final = 86_400.0


@dataclass(frozen=True, kw_only=True)
class Swept:
    """What a sweep removed, or would remove."""

    jobs: int  #: old jobs, with all their records
    deleted: int = 0  #: and those that were deleted, with theirs
    sums: int = 0  #: checkpoints of ended jobs, from which another could have continued
    scenes: int
    orphans: int  #: blobs of no job, of no use to their job, or half put
    blobs: int  #: in all
    freed_bytes: int  #: in the blob store


def sweep(
    client: RedisClient,
    store: Blobs,
    *,
    results_older_than_s: float | None = None,
    deleted_older_than_s: float | None = None,
    sums_older_than_s: float | None = None,
    scenes_unused_for_s: float | None = None,
    dry_run: bool = False,
) -> Swept:
    """Remove everything that is not needed any more, or in a dry run only count it.

    Parameters
    ----------
    client, store
        Redis, and the blob store that belongs to it.
    results_older_than_s
        Forget the jobs that finished this long ago; None keeps them.
    deleted_older_than_s
        Forget the jobs that were deleted this long ago; None keeps them.
    sums_older_than_s
        Drop the sums of jobs that finished this long ago; None keeps them.
    scenes_unused_for_s
        Remove scenes of no job that were unused for this long, at least an hour; None keeps them.
    dry_run
        Remove nothing.

    Raises
    ------
    WrongStore
        The blob store belongs to another Redis: nothing was removed.
    StoreUnavailable
        Redis or the blob store is away: the next sweep does the rest.
    """
    check_pair(client, store)
    removal = Removal(store, dry_run=dry_run)
    jobs = FinishedJobs(client, removal)
    if results_older_than_s is not None:
        jobs.forget(results_older_than_s)
    old = len(jobs.forgotten)
    if deleted_older_than_s is not None:
        jobs.forget_deleted(deleted_older_than_s)
    if sums_older_than_s is not None:
        jobs.let_sums_go(sums_older_than_s)
    orphans = remove_orphans(client, removal, jobs.forgotten)
    scenes = 0
    if scenes_unused_for_s is not None:
        scenes = remove_scenes(client, removal, scenes_unused_for_s, jobs.forgotten)
    orphans += removal.remove_half_put()
    return Swept(
        jobs=old,
        deleted=len(jobs.forgotten) - old,
        sums=jobs.sums,
        scenes=scenes,
        orphans=orphans,
        blobs=removal.blobs,
        freed_bytes=removal.freed_bytes,
    )


def is_due(client: RedisClient, every_s: float) -> bool:
    """Whether this call has begun no sweep for this long; if so, the caller's begins now."""
    return Scripts(client).run(BeginSweep(every_ms=round(every_s * 1000)))


def in_seconds(days: float | None) -> float | None:
    """Seconds of the days after which `sweep` removes something; None where it is kept."""
    return None if days is None else days * _DAY_S
