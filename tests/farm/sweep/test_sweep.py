"""A sweep removes what nobody needs, and nothing that anybody does, whatever happens beside it."""

import itertools
import json
import os
import pkgutil
import random
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import redis

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.continuation import Continuations
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.queue import Lease, SliceQueue, SliceRecord
from plateau.farm.ledger.scene_index import SceneIndex
from plateau.farm.model.errors import FenceLost, JobNotFound, StoreUnavailable, WrongStore
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from plateau.farm.redis.commands.scenes import ForgetScene
from plateau.farm.sweep import Swept, sweep
from tests.support.farms.staged_job import StagedJob

DAY_S = 86_400.0
NOTHING = Swept(jobs=0, scenes=0, orphans=0, blobs=0, freed_bytes=0)
SCENE = "ab" * 32


def finished(client: redis.Redis, store: Blobs, *, days_ago: float = 0, **spec: Any) -> StagedJob:
    """A job with its three pictures that was finished so long ago."""
    job = StagedJob(client, **spec)
    job.commit(4)
    job.point(100, 5)
    job.end()
    for name in ("image.exr", "image.png", "difference.png"):
        job.picture(store, name, b"0123456789")
    job.finish()
    at = float(client.hget(keys.job(job.id), "finished_at"))
    client.hset(keys.job(job.id), "finished_at", at - round(days_ago * DAY_S * 1000))
    return job


def keys_of(client: redis.Redis, job_id: str) -> set[str]:
    return set(client.scan_iter(f"{keys.job(job_id)}*", count=1000))


def dies_at_call(monkeypatch: pytest.MonkeyPatch, store: Blobs, method: str, number: int) -> None:
    """Have the sweep end at this call, as if it were killed."""
    original, calls = getattr(store, method), itertools.count(1)

    def dying(*arguments: Any) -> Any:
        if next(calls) == number:
            raise KeyboardInterrupt
        return original(*arguments)

    monkeypatch.setattr(store, method, dying)


def just_before(
    monkeypatch: pytest.MonkeyPatch, method: str, argument: str | type, do: Callable[[], None]
) -> None:
    """Do something once, just before a method is called with this, or such a, first argument."""
    original, done = pkgutil.resolve_name(method), threading.Event()

    def with_more(self: Any, *arguments: Any) -> Any:
        if argument in (arguments[0], type(arguments[0])) and not done.is_set():
            done.set()
            do()
        return original(self, *arguments)

    monkeypatch.setattr(method, with_more)


def orphan(store: Blobs, job_id: str) -> list[str]:
    """What killed workers and monitors may leave of a job."""
    names = [
        blobs.partial(job_id, 3, "killed-1"),
        f"{blobs.checkpoints(job_id)}0000100-1.npz",
        f"{blobs.results(job_id)}0000100-1/image.png",
    ]
    for name in names:
        store.put(name, b"12345")
    return names


class TestFinishedJobs:
    def test_go_whole_after_the_retention(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        old = finished(client, store, days_ago=8)
        new = finished(client, store, days_ago=6)
        kept_keys, kept_blobs = keys_of(client, new.id), store.names(f"jobs/{new.id}/")
        assert keys_of(client, old.id)
        swept = sweep(client, store, results_older_than_s=7 * DAY_S)
        assert swept == Swept(jobs=1, scenes=0, orphans=0, blobs=3, freed_bytes=30)
        # Nothing is left of the old one
        assert keys_of(client, old.id) == set()
        assert store.names(f"jobs/{old.id}/") == []
        with pytest.raises(JobNotFound):
            jobs.get(old.id)
        assert [job.id for job in jobs.search()[0]] == [new.id]
        # And all of the new one
        assert keys_of(client, new.id) == kept_keys
        assert store.names(f"jobs/{new.id}/") == kept_blobs
        assert sweep(client, store, results_older_than_s=7 * DAY_S) == NOTHING

    def test_every_key_of_a_job_is_known_to_go(self) -> None:
        listed = {
            line.split()[0].removeprefix("plateau:job:ID:")
            for line in (keys.__doc__ or "").splitlines()
            if line.startswith("plateau:job:ID:")
        }
        assert listed == set(keys.JOB_PARTS)

    def test_a_dry_run_says_the_same_and_removes_nothing(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        finished(client, store, days_ago=8)
        orphan(store, finished(client, store, days_ago=8).id)
        orphan(store, finished(client, store).id)
        store.put(blobs.scene(SCENE), b"scene")
        client.zadd(keys.SCENES_USED, {SCENE: 0})
        check_pair(client, store)
        before = sorted(client.scan_iter("*", count=1000)), sorted(store.names(""))
        asked = {"results_older_than_s": 7 * DAY_S, "scenes_unused_for_s": 7 * DAY_S}
        said = sweep(client, store, **asked, dry_run=True)
        assert (sorted(client.scan_iter("*", count=1000)), sorted(store.names(""))) == before
        assert sweep(client, store, **asked) == said
        assert asdict(said) == {
            "jobs": 2,
            "deleted": 0,
            "sums": 0,
            "scenes": 1,
            "orphans": 3,
            "blobs": 3 + 6 + 3 + 1,
            "freed_bytes": 30 + 45 + 15 + 5,
        }

    def test_go_some_time_after_they_were_deleted(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        deletions, gone, restored, late = (
            Deletions(client),
            *(finished(client, store) for _ in range(3)),
        )
        for job in (gone, restored, late):
            deletions.set(job.id, deleted=True)
        for job in (gone, restored):
            at = float(client.hget(keys.job(job.id, "sealed"), "deleted_at"))
            client.hset(keys.job(job.id, "sealed"), "deleted_at", at - round(DAY_S * 1000))
        asked = {"deleted_older_than_s": DAY_S}
        assert sweep(client, store, **asked, dry_run=True).deleted == 2
        deletions.set(restored.id, deleted=False)
        swept = sweep(client, store, **asked)
        assert swept == Swept(jobs=0, deleted=1, scenes=0, orphans=0, blobs=3, freed_bytes=30)
        assert keys_of(client, gone.id) == set()
        assert store.names(f"jobs/{gone.id}/") == []
        every = jobs.search(deleted=None)[0]
        assert [job.id for job in every] == [late.id, restored.id]
        assert client.zrange(keys.DELETED, 0, -1) == [late.id]

    def test_one_that_was_deleted_stays_while_another_continues_it(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        deletions, old = Deletions(client), finished(client, store, keep_slices=True)
        continuations = Continuations(client)
        spec = old.spec.model_copy(update={"max_spp": 20_000})
        remains = continuations.remains(jobs.get(old.id))
        new = continuations.start(jobs.get(old.id), remains, spec, idempotency_key="").job
        deletions.set(old.id, deleted=True)
        assert sweep(client, store, deleted_older_than_s=0) == NOTHING
        assert jobs.get(old.id).deleted_at is not None
        # Until that one has gone, too
        staged = StagedJob(client, new.id)
        staged.end(JobState.CANCELLED)
        staged.finish()
        deletions.set(new.id, deleted=True)
        assert sweep(client, store, deleted_older_than_s=0).deleted == 2
        assert jobs.search(deleted=None)[0] == []

    @pytest.mark.parametrize("stage", ["queued", "rendering", "ended"])
    def test_but_never_one_that_is_not_finished(
        self, client: redis.Redis, jobs: Jobs, store: Blobs, stage: str
    ) -> None:
        if stage == "queued":
            job_id = jobs.create(JobSpec(), name="a", scene_sha256=SCENE).job.id
        else:
            job = StagedJob(client)
            job.commit(4)
            if stage == "ended":
                job.end()
            job_id = job.id
        names = orphan(store, job_id)
        before = keys_of(client, job_id)
        assert sweep(client, store, results_older_than_s=0) == NOTHING
        assert keys_of(client, job_id) == before
        assert sorted(store.names(blobs.of_job(job_id))) == sorted(names)

    def test_whoever_comes_back_to_one_brings_nothing_of_it_back(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        # Given a worker that has a slice of a job which ends, is finished and forgotten meanwhile
        job = finished(client, store, days_ago=8)
        lease = Lease(
            job_id=job.id,
            entry="1-0",
            index=3,
            tries=1,
            variant="scalar_rgb",
            spec=job.spec,
            scene_sha256=SCENE,
        )
        record = SliceRecord.model_validate(Jobs(client).ledger(job.id)[3])
        sweep(client, store, results_older_than_s=0)
        # If it commits, complains, or gives it back
        queue = SliceQueue(client, "worker-1", 60)
        answer = queue.commit(lease, record, width=32, height=24, notes=(), said="words")
        assert answer == "ended"
        queue.died(lease, "killed", 1.0, "words")
        queue.hand_back(lease)
        queue.fail(lease, "not my fault")
        assert queue.heartbeat({"id": "worker-1"}, (lease,)) == (lease,)
        # Then Redis still has nothing of the job
        assert keys_of(client, job.id) == set()
        assert client.scard(keys.UNFINISHED) == client.zcard(keys.OPEN) == 0

    def test_a_monitor_that_comes_back_to_one_has_lost_it(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        job = finished(client, store, days_ago=8)
        sweep(client, store, results_older_than_s=0)
        assert Ownerships(client, 60).acquire(job.id) is None
        with pytest.raises(FenceLost):
            job.commit()
        assert keys_of(client, job.id) == set()


class TestOrphans:
    def test_of_a_job_that_is_not_known_go(self, client: redis.Redis, store: Blobs) -> None:
        finished(client, store)
        orphan(store, "0123456789ab")
        store.put("jobs/0123456789ab/of-a-later-version", b"x")
        assert sweep(client, store).orphans == 4
        assert store.names("jobs/0123456789ab/") == []

    def test_slices_that_a_job_keeps_are_none(self, client: redis.Redis, store: Blobs) -> None:
        job = finished(client, store, keep_slices=True)
        for index, record in Jobs(client).ledger(job.id).items():
            record["blob"] = blobs.partial(job.id, index, "counts")
            stored = json.dumps({"at": record["at"], "record": json.dumps(record)})
            client.hset(keys.job(job.id, "ledger"), str(index), stored)
            store.put(record["blob"], b"slice")
        kept = store.names(f"jobs/{job.id}/")
        assert len(kept) == 3 + 4
        orphan(store, job.id)
        assert sweep(client, store).orphans == 3
        assert sorted(store.names(f"jobs/{job.id}/")) == sorted(kept)

    def test_of_a_finished_job_that_cannot_be_read_stay_and_of_others_go(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        odd, other = finished(client, store), finished(client, store)
        client.hset(keys.job(odd.id), "spec", json.dumps({"rule": {"name": "newer"}}))
        orphan(store, odd.id)
        orphan(store, other.id)
        assert sweep(client, store).orphans == 3
        assert len(store.names(f"jobs/{odd.id}/")) == 3 + 3

    def test_a_kind_of_blob_that_is_not_known_is_left_alone(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        job = finished(client, store)
        store.put(f"jobs/{job.id}/of-a-later-version", b"x")
        assert sweep(client, store) == NOTHING

    def test_of_puts_that_were_killed_go_when_they_are_old(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        incoming = Path(store.where) / ".incoming"
        incoming.mkdir()
        for name, age_s in (("old", 2 * DAY_S), ("new", 60)):
            (incoming / name).write_bytes(b"half a bl")
            os.utime(incoming / name, (time.time() - age_s,) * 2)
        swept = sweep(client, store)
        assert (swept.orphans, swept.freed_bytes) == (1, 9)
        assert [path.name for path in incoming.iterdir()] == ["new"]

    def test_a_sweep_that_dies_leaves_them_for_the_next(
        self, client: redis.Redis, store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        job = finished(client, store, days_ago=8)
        dies_at_call(monkeypatch, store, "delete", 2)
        with pytest.raises(KeyboardInterrupt):
            sweep(client, store, results_older_than_s=7 * DAY_S)
        # The job is forgotten, but some of its blobs are still there
        assert keys_of(client, job.id) == set()
        assert len(store.names(f"jobs/{job.id}/")) == 2
        monkeypatch.undo()
        assert sweep(client, store) == Swept(jobs=0, scenes=0, orphans=2, blobs=2, freed_bytes=20)
        assert store.names("jobs/") == []

    def test_a_job_that_is_created_meanwhile_loses_nothing(
        self, client: redis.Redis, jobs: Jobs, store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        finished(client, store)
        orphan(store, "0123456789ab")
        created: list[str] = []
        listing = store.listing

        def with_a_new_job(prefix: str) -> Any:
            for blob in listing(prefix):
                if prefix == blobs.JOBS and not created:
                    created.append(jobs.create(JobSpec(), name="a", scene_sha256=SCENE).job.id)
                    orphan(store, created[0])
                yield blob
            if prefix == blobs.JOBS:
                yield from listing(blobs.of_job(created[0]))

        monkeypatch.setattr(store, "listing", with_a_new_job)
        assert sweep(client, store).orphans == 3
        assert len(store.names(blobs.of_job(created[0]))) == 3


def test_a_redis_that_lost_its_data_sweeps_nothing(client: redis.Redis, store: Blobs) -> None:
    finished(client, store)
    assert sweep(client, store) == NOTHING
    before = sorted(store.names(""))
    client.flushall()
    for _ in range(2):
        with pytest.raises(WrongStore, match="has lost its data"):
            sweep(client, store)
        finished(client, store)  # and goes on as if nothing had been
    assert set(before) <= set(store.names(""))


class TestScenes:
    def keep(self, client: redis.Redis, store: Blobs, sha256: str, *, days_ago: float) -> None:
        """Submit a scene so long ago."""
        jobs = Jobs(client)
        SceneIndex(client).use(sha256)
        store.put(blobs.scene(sha256), b"scene")
        SceneIndex(client).remember(sha256, {"name": "a.xml"})
        then = jobs.now_ms() - days_ago * DAY_S * 1000
        client.zadd(keys.SCENES_USED, {sha256: then})

    def test_go_when_no_job_has_them_and_they_were_not_used(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        for sha256, days_ago in (("unused", 8), ("used", 6), ("rendered", 8), ("finished", 8)):
            self.keep(client, store, sha256, days_ago=days_ago)
        jobs.create(JobSpec(), name="a", scene_sha256="rendered")
        done = finished(client, store, days_ago=8)
        client.hset(keys.job(done.id), "scene_sha256", "finished")
        swept = sweep(client, store, scenes_unused_for_s=7 * DAY_S)
        assert (swept.scenes, swept.freed_bytes) == (1, 5)
        assert {one["sha256"] for one in SceneIndex(client).all()} == {
            "used",
            "rendered",
            "finished",
        }
        assert len(store.names(blobs.SCENES)) == 3
        # The finished job's goes when the job does
        swept = sweep(client, store, results_older_than_s=7 * DAY_S, scenes_unused_for_s=7 * DAY_S)
        assert (swept.jobs, swept.scenes) == (1, 1)
        assert not store.exists(blobs.scene("finished"))
        assert set(client.zrange(keys.SCENES_USED, 0, -1)) == {"used", "rendered"}

    def test_one_just_used_stays_whatever_the_retention(
        self, client: redis.Redis, store: Blobs
    ) -> None:
        self.keep(client, store, SCENE, days_ago=0.5 / 24)
        assert sweep(client, store, scenes_unused_for_s=0) == NOTHING
        self.keep(client, store, SCENE, days_ago=1.5 / 24)
        assert sweep(client, store, scenes_unused_for_s=0).scenes == 1

    def test_one_of_which_no_use_was_noted_goes_after_another_retention(
        self, client: redis.Redis, jobs: Jobs, store: Blobs
    ) -> None:
        store.put(blobs.scene(SCENE), b"scene")
        for _ in range(2):
            assert sweep(client, store, scenes_unused_for_s=7 * DAY_S) == NOTHING
        noted = client.zscore(keys.SCENES_USED, SCENE)
        assert noted == pytest.approx(jobs.now_ms(), abs=60_000)
        client.zadd(keys.SCENES_USED, {SCENE: noted - 8 * DAY_S * 1000})
        assert sweep(client, store, scenes_unused_for_s=7 * DAY_S).scenes == 1

    @pytest.mark.parametrize("then", ["the job is created", "not yet"])
    def test_one_that_is_submitted_before_the_decision_stays(
        self,
        client: redis.Redis,
        jobs: Jobs,
        store: Blobs,
        monkeypatch: pytest.MonkeyPatch,
        then: str,
    ) -> None:
        # Given a sweep that has found a scene unused, and one that submits it just then
        self.keep(client, store, SCENE, days_ago=8)

        def submit() -> None:
            SceneIndex(client).use(SCENE)
            assert store.exists(blobs.scene(SCENE))  # so it is not put again
            if then == "the job is created":
                jobs.create(JobSpec(), name="a", scene_sha256=SCENE)

        just_before(monkeypatch, "plateau.farm.redis.scripts.Scripts.run", ForgetScene, submit)
        # Then the script sees the use, and the scene stays
        assert sweep(client, store, scenes_unused_for_s=7 * DAY_S) == NOTHING
        assert store.exists(blobs.scene(SCENE))

    def test_one_that_is_submitted_while_it_goes_is_put_again(
        self, client: redis.Redis, jobs: Jobs, store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("plateau.farm.ledger.scene_index._SCENE_GOES_S", 600.0)
        # Given a sweep that has decided, and has not removed the blob yet
        self.keep(client, store, SCENE, days_ago=8)
        found: list[bool] = []

        def submit() -> None:
            SceneIndex(client).use(SCENE)
            found.append(store.exists(blobs.scene(SCENE)))
            store.put(blobs.scene(SCENE), b"scene")

        submitting = threading.Thread(target=submit)

        def begin() -> None:
            submitting.start()
            time.sleep(0.3)
            assert found == []  # it waits

        just_before(monkeypatch, "plateau.farm.blobs.store.Blobs.delete", blobs.scene(SCENE), begin)
        assert sweep(client, store, scenes_unused_for_s=7 * DAY_S).scenes == 1
        # Then whoever submits it finds it gone, puts it again, and it stays
        submitting.join(60)
        assert found == [False]
        assert sweep(client, store, scenes_unused_for_s=7 * DAY_S) == NOTHING
        assert store.exists(blobs.scene(SCENE))

    def test_one_whose_sweep_died_is_refused_for_a_while_and_not_lost(
        self, client: redis.Redis, jobs: Jobs, store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.keep(client, store, SCENE, days_ago=8)
        dies_at_call(monkeypatch, store, "delete", 1)
        with pytest.raises(KeyboardInterrupt):
            sweep(client, store, scenes_unused_for_s=7 * DAY_S)
        monkeypatch.undo()
        monkeypatch.setattr("plateau.farm.ledger.scene_index._SCENE_GOES_S", 0.2)
        with pytest.raises(StoreUnavailable, match="being removed"):
            SceneIndex(client).use(SCENE)
        assert 0 < client.pttl(keys.scene_going(SCENE)) <= 300_000
        client.delete(keys.scene_going(SCENE))  # as time does
        SceneIndex(client).use(SCENE)
        assert sweep(client, store, scenes_unused_for_s=7 * DAY_S) == NOTHING
        assert store.exists(blobs.scene(SCENE))

    def test_submitting_and_sweeping_at_once_never_loses_one(
        self, client: redis.Redis, jobs: Jobs, store: Blobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("plateau.farm.ledger.scene_index._SCENE_GOES_S", 600.0)
        # Given scenes that are submitted again and again, while sweeps run that think them old
        over, missing, draw = threading.Event(), list[str](), random.Random(0)

        def submit(sha256: str) -> None:
            while not over.is_set():
                SceneIndex(client).use(sha256)
                if not store.exists(blobs.scene(sha256)):
                    store.put(blobs.scene(sha256), b"scene")
                job = jobs.create(JobSpec(), name="a", scene_sha256=sha256).job
                time.sleep(0.02)
                if not store.exists(blobs.scene(sha256)):
                    missing.append(job.id)
                # The job goes, and the scene was used long ago
                client.zrem(keys.JOBS, job.id)
                client.zadd(keys.SCENES_USED, {sha256: 0}, xx=True)
                time.sleep(draw.uniform(0, 0.03))

        threads = [threading.Thread(target=submit, args=(f"scene-{n}",)) for n in range(3)]
        for thread in threads:
            thread.start()
        removed, deadline = 0, time.monotonic() + 250
        while removed < 20 and time.monotonic() < deadline:
            removed += sweep(client, store, scenes_unused_for_s=0).scenes
        over.set()
        for thread in threads:
            thread.join()
        assert missing == []
        assert removed >= 10
