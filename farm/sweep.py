"""Removes what nobody needs any more: old jobs, unused scenes, and blobs that nothing refers to.

A sweep may be killed at any point and run beside another: what Redis says of a job or a scene goes
first, in one atomic script, and its blobs after it. What a killed sweep leaves are blobs that
nothing refers to, and the next one takes them.

**Jobs.** Only a finished one is forgotten: no monitor has work with it, and none takes it again. A
zombie worker or monitor that comes back to it is told that the job has ended, or has lost its
fence; what it put before is an orphan.

A job that another one goes on with stays as long as that one: its slices may be all that the other
has. Its sums stay until the other has sums of its own, or has let these go too.

**Orphans.** A job is in Redis before its first blob is put, and its id is never given again. So a
blob in a listing whose job Redis does not know, when asked after the listing, belongs to a job
that is gone for good. Of a finished job the set of results and the ledger change no more, so
whatever else it has in these places is what a process left that was killed, or came too late. Of
an unfinished job nothing is touched, and neither is a kind of blob that this module does not know.

**Scenes.** The danger is one that is submitted again just as it goes: the API sees its blob and
does not put it again, the sweep removes it, and the job has no scene. Therefore

1. the API notes the use (`SceneIndex.use`), then looks whether the scene is going, then at the
   blob;
2. a sweep fixes a moment, an hour in the past or more, then reads which scenes the jobs have, and
   asks ``forget_scene.lua`` for each other scene that was last used before that moment: the
   script looks once more, forgets the scene and says that it is going, in one step; the sweep
   removes the blob; then it says that the scene is gone.

Where the note is first, the script finds it and keeps the scene. Where the script is first, the
API finds the scene going, waits, and then puts the blob again. A job that is created after the
sweep has read the jobs has a note that is younger than the moment, unless its API took an hour
between note and job. A sweep that dies in between leaves the scene going for five minutes, in
which the API answers 503 for this scene. What is left open: a sweep that is suspended for these
minutes exactly between its look at the clock and its call to the blob store.

A scene without a note, from before there were notes or from a sweep that died, gets one by the
first sweep that sees it; its time runs from then.

**Studies** have pictures of their own, see `farm.studies`; only those of unfinished ones go.

**Whose blobs?** A Redis that lost its data, or the wrong one, knows none of the jobs, and all
results would be orphans. So nothing is removed where `farm.pairing` says that the two do not belong
together.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from typing import Final

import redis

from farm import blobs, keys, studies
from farm.blobs import Blobs, StoredBlob
from farm.jobs import Jobs
from farm.ownership import Checkpoint
from farm.pairing import check_pair
from farm.redis_link import unavailable_as_farm_error
from farm.scripts import Scripts
from farm.spec import stored_spec

#: A scene that was used within this time is kept. No request takes so long.
_IN_USE_S: Final = 3600.0
#: So long the API takes a scene's blob not to be there, should a sweep die while it removes it.
_GOING_S: Final = 300.0
#: By then the removal must have begun: the rest of the time is for the blob store's own retries.
_BEGINS_WITHIN_S: Final = 60.0
#: No put takes so long.
_LEFT_S: Final = 86_400.0
_PAGE: Final = 500


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
    client: redis.Redis,
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
        sweeping = _Sweep(client, store, dry_run=dry_run)
        if results_older_than_s is not None:
            sweeping.jobs(results_older_than_s)
        if sums_older_than_s is not None:
            sweeping.sums(sums_older_than_s)
        sweeping.orphans()
        if scenes_unused_for_s is not None:
            sweeping.scenes(scenes_unused_for_s)
        sweeping.leftovers()
    return sweeping.swept()


def is_due(client: redis.Redis, every_s: float) -> bool:
    """Whether no sweep was begun by this call for so long; then the caller's begins now."""
    with unavailable_as_farm_error():
        return bool(client.set(keys.SWEPT, "1", nx=True, px=round(every_s * 1000)))


class _Sweep:
    """One sweep, and what it has removed so far."""

    def __init__(self, client: redis.Redis, store: Blobs, *, dry_run: bool) -> None:
        self._redis = client
        self._scripts = Scripts(client)
        self._jobs = Jobs(client)
        self._store = store
        self._dry_run = dry_run
        self._forgotten: set[str] = set()
        self._sums = self._scenes = self._orphans = self._blobs = self._bytes = 0

    def swept(self) -> Swept:
        """What was removed so far."""
        return Swept(
            jobs=len(self._forgotten),
            sums=self._sums,
            scenes=self._scenes,
            orphans=self._orphans,
            blobs=self._blobs,
            freed_bytes=self._bytes,
        )

    def jobs(self, older_than_s: float) -> None:
        """Forget the jobs that have been finished for so long."""
        older_than_ms = round(older_than_s * 1000)
        continuing = self._continuing()
        for job_id in self._finished_for(older_than_ms):
            if self._dry_run:
                goes = self._forgotten.issuperset(continuing[job_id])
            else:
                goes = self._scripts.run("forget", job_id, older_than_ms) == "forgotten"
            if goes:
                self._forgotten.add(job_id)
                self._remove(list(self._store.listing(blobs.of_job(job_id))))

    def sums(self, older_than_s: float) -> None:
        """Let the sums go of jobs that have been finished for so long."""
        older_than_ms = round(older_than_s * 1000)
        continuing, left = self._continuing(), dict(self._field_of_all("checkpoint"))
        for job_id in self._forgotten:
            left[job_id] = None
        for job_id in self._finished_for(older_than_ms):
            checkpoint, others = left.get(job_id), continuing[job_id]
            if checkpoint is None:
                continue
            if self._dry_run:
                goes = all(left.get(other) != checkpoint for other in others)
            else:
                goes = self._scripts.run("drop_sums", job_id, older_than_ms, *others) == "dropped"
            if goes:
                left[job_id] = None
                blob = Checkpoint.model_validate_json(checkpoint).blob
                size = self._store.size(blob)
                if size is not None and blob.startswith(blobs.of_job(job_id)):
                    self._remove([StoredBlob(blob, size)])
                    self._sums += 1

    def orphans(self) -> None:
        """Remove blobs of unknown jobs, and what finished ones do not need."""
        found: dict[str, list[StoredBlob]] = {}
        # A job's blobs come one after the other; where a store mixes them, it is asked for twice.
        for job_id, stored in groupby(self._store.listing(blobs.JOBS), _job_of):
            if job_id not in self._forgotten:
                keeps = self._keeps(job_id)
                for blob in stored:
                    if not keeps(blob.name):
                        found.setdefault(job_id, []).append(blob)
        for job_id, orphans in found.items():
            keeps = self._keeps(job_id)
            self._orphans += self._remove(blob for blob in orphans if not keeps(blob.name))
        self._orphans += self._remove(studies.orphans(self._redis, self._store))

    def scenes(self, unused_for_s: float) -> None:
        """Remove scenes of no job that were not used for so long."""
        now = self._jobs.now_ms()
        before = now - round(max(unused_for_s, _IN_USE_S) * 1000)
        stored = {
            blob.name.removeprefix(blobs.SCENES): blob for blob in self._store.listing(blobs.SCENES)
        }
        used = dict(self._redis.zrange(keys.SCENES_USED, 0, -1, withscores=True))
        unnoted = (stored.keys() | self._redis.hkeys(keys.SCENES)) - used.keys()
        if unnoted and not self._dry_run:
            self._redis.zadd(keys.SCENES_USED, dict.fromkeys(unnoted, now), nx=True)
        wanted = {
            scene
            for job_id, scene in self._field_of_all("scene_sha256")
            if job_id not in self._forgotten
        }
        for sha256 in sorted(used.keys() - wanted):
            if used[sha256] < before:
                self._forget_scene(sha256, stored.get(sha256), before)

    def leftovers(self) -> None:
        """Remove what puts left that were killed."""
        for path in self._store.leftovers(_LEFT_S):
            with suppress(FileNotFoundError):  # another sweep was first
                size = path.stat().st_size
                if not self._dry_run:
                    path.unlink()
                self._count(size)
                self._orphans += 1

    def _forget_scene(self, sha256: str, blob: StoredBlob | None, before_ms: int) -> None:
        asked = time.monotonic()
        if not self._dry_run:
            arguments = (sha256, before_ms, round(_GOING_S * 1000))
            if self._scripts.run("forget_scene", *arguments) != "forgotten":
                return
        if time.monotonic() - asked > _BEGINS_WITHIN_S:
            return  # we were suspended, and by now the API may count on the blob
        if blob is not None:
            self._remove([blob])
            self._scenes += 1
        if not self._dry_run:
            self._redis.delete(keys.scene_going(sha256))

    def _keeps(self, job_id: str) -> Callable[[str], bool]:
        """Whether the job, as Redis knows it now, keeps the blob of a name."""
        job = keys.job(job_id)
        spec, finished_at, results, checkpoint = self._redis.hmget(
            job, "spec", "finished_at", "results", "checkpoint"
        )
        if spec is None:
            return lambda _: False
        if finished_at is None:
            return lambda _: True
        kept: set[str] = set()
        if stored_spec(spec).keep_slices:
            kept = {record["blob"] for record in self._jobs.ledger(job_id).values()}
        if checkpoint is not None:
            kept.add(Checkpoint.model_validate_json(checkpoint).blob)
        swept = (blobs.partials(job_id), blobs.checkpoints(job_id), blobs.results(job_id))
        return lambda name: (
            name in kept or name.startswith(f"{results or ''}/") or not name.startswith(swept)
        )

    def _continuing(self) -> defaultdict[str, list[str]]:
        """Of each job, the jobs that go on with it."""
        continuing = defaultdict[str, list[str]](list)
        for job_id, continues in self._field_of_all("continues"):
            if continues is not None:
                continuing[continues].append(job_id)
        return continuing

    def _finished_for(self, older_than_ms: int) -> list[str]:
        """The jobs that have been finished for so long, from the newest on.

        So one that goes on with another comes before it.
        """
        before = self._jobs.now_ms() - older_than_ms
        newest_first = reversed(list(self._field_of_all("finished_at")))
        return [job_id for job_id, at in newest_first if at is not None and float(at) <= before]

    def _field_of_all(self, field: str) -> Iterator[tuple[str, str | None]]:
        """A field of every job."""
        ids = self._redis.zrange(keys.JOBS, 0, -1)
        for start in range(0, len(ids), _PAGE):
            page = ids[start : start + _PAGE]
            pipe = self._redis.pipeline(transaction=False)
            for job_id in page:
                pipe.hget(keys.job(job_id), field)
            yield from zip(page, pipe.execute(), strict=True)

    def _remove(self, found: Iterable[StoredBlob]) -> int:
        """Remove these blobs; returns how many they were."""
        before = self._blobs
        for blob in found:
            if not self._dry_run:
                self._store.delete(blob.name)
            self._count(blob.size)
        return self._blobs - before

    def _count(self, size: int) -> None:
        self._blobs += 1
        self._bytes += size


def _job_of(blob: StoredBlob) -> str:
    return blob.name.split("/")[1]
