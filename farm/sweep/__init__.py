"""Removes what nobody needs any more: old jobs, unused scenes, and blobs that nothing refers to.

A sweep may be killed at any point and run beside another: what Redis says of a job or a scene goes
first, in one atomic script, and its blobs after it. What a killed sweep leaves are blobs that
nothing refers to, and the next one takes them. Why nothing goes that is needed, `finished_jobs`,
`orphans` and `scenes` say, each for its own.

**Whose blobs?** A Redis that lost its data, or the wrong one, knows none of the jobs, and all
results would be orphans. So nothing is removed where `plateau.farm.ledger.pairing` says that the
two do not belong together.
"""

from dataclasses import dataclass

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.sweeps import BeginSweep
from plateau.farm.redis.link import unavailable_as_farm_error
from plateau.farm.redis.scripts import Scripts
from plateau.farm.sweep.finished_jobs import FinishedJobs
from plateau.farm.sweep.orphans import remove_orphans
from plateau.farm.sweep.removal import Removal
from plateau.farm.sweep.scenes import remove_scenes

__all__ = ["Swept", "is_due", "sweep"]


@dataclass(frozen=True, kw_only=True)
class Swept:
    """What a sweep removed, or would remove."""

    jobs: int  #: finished jobs, with all that was known of them
    sums: int = 0  #: checkpoints of ended jobs, from which another could have gone on
    scenes: int
    orphans: int  #: blobs of no job, of no use to their job, or half put
    blobs: int  #: in all
    freed_bytes: int  #: in the blob store


def sweep(
    client: RedisClient,
    store: Blobs,
    *,
    results_older_than_s: float | None = None,
    sums_older_than_s: float | None = None,
    scenes_unused_for_s: float | None = None,
    dry_run: bool = False,
) -> Swept:
    """Remove what is not needed any more; returns what that was.

    Parameters
    ----------
    client, store
        Redis, and the blob store that belongs to it.
    results_older_than_s
        Forget the jobs that have been finished for so long; None to keep them.
    sums_older_than_s
        Let the sums go, which another job could go on from, of jobs that have been finished for so
        long; None to keep them.
    scenes_unused_for_s
        Remove scenes that no job has and that were not used for so long, which is an hour at
        least; None to keep them.
    dry_run
        Remove nothing.

    Raises
    ------
    WrongStore
        The blob store belongs to another Redis: nothing was removed.
    StoreUnavailable
        Redis or the blob store is away: the next sweep does the rest.
    """
    with unavailable_as_farm_error():
        check_pair(client, store)
        removal = Removal(store, dry_run=dry_run)
        jobs = FinishedJobs(client, removal)
        if results_older_than_s is not None:
            jobs.forget(results_older_than_s)
        if sums_older_than_s is not None:
            jobs.let_sums_go(sums_older_than_s)
        orphans = remove_orphans(client, removal, jobs.forgotten)
        scenes = 0
        if scenes_unused_for_s is not None:
            scenes = remove_scenes(client, removal, scenes_unused_for_s, jobs.forgotten)
        orphans += removal.remove_half_put()
    return Swept(
        jobs=len(jobs.forgotten),
        sums=jobs.sums,
        scenes=scenes,
        orphans=orphans,
        blobs=removal.blobs,
        freed_bytes=removal.freed_bytes,
    )


def is_due(client: RedisClient, every_s: float) -> bool:
    """Whether no sweep was begun by this call for so long; then the caller's begins now."""
    return Scripts(client).run(BeginSweep(every_ms=round(every_s * 1000)))
