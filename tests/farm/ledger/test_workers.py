"""Workers: draining them, and what each has saved."""

from pathlib import Path

import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import Committed, SliceQueue
from plateau.farm.ledger.workers import Workers
from plateau.farm.model.errors import WorkerNotFound
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.staged_job import StagedJob


@pytest.fixture
def farm(client: redis.Redis, redis_url: str, tmp_path: Path) -> NoiseFarm:
    return NoiseFarm(client, redis_url, tmp_path)


def about(name: str) -> dict[str, object]:
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


def test_a_drained_worker_finishes_what_it_has_and_takes_no_more(
    farm: NoiseFarm, client: redis.Redis
) -> None:
    workers = Workers(client)
    farm.queue.heartbeat(about("noise"), ())
    farm.submit()
    with farm.monitor():
        farm.render(1)
        lease = farm.lease()
        assert lease is not None
        # When it is drained with a slice in hand
        workers.drain("noise")
        workers.drain("noise")  # repeating it is harmless
        # Then there is nothing for it, it says so, and what it has in hand counts
        assert farm.lease() is None
        assert [one.drained for one in farm.jobs.workers()] == [True]
        assert farm.commit(lease) is Committed.COMMITTED
        # A heartbeat does not forget it
        farm.queue.heartbeat(about("noise"), ())
        assert farm.lease() is None
        # And it can work again
        workers.resume("noise")
        workers.resume("noise")
        assert [one.drained for one in farm.jobs.workers()] == [False]
        farm.render(1)


def test_others_go_on(farm: NoiseFarm, client: redis.Redis) -> None:
    SliceQueue(client, "other", 60).heartbeat(about("other"), ())
    Workers(client).drain("other")
    farm.submit()
    with farm.monitor():
        farm.render(2)


def test_what_a_job_saved_is_shared_out_by_samples(client: redis.Redis) -> None:
    # Given a job of 1000 spp at most, of which one worker rendered three times as much as the other
    job = StagedJob(client, max_spp=1000)
    for worker in ("worker-1", "worker-2"):
        SliceQueue(client, worker, 60).heartbeat(about(worker), ())
    job.commit(3)
    job.commit(worker="worker-2")
    # Then neither has saved anything before it converges
    jobs = Jobs(client)
    assert [one.saved_core_hours for one in jobs.workers()] == [0, 0]
    job.point(100, 0)
    job.end()
    saved = {one.id: one.saved_core_hours for one in jobs.workers()}
    whole = jobs.get(job.id).saved_core_hours
    assert whole == pytest.approx(9 * jobs.get(job.id).core_hours)
    assert saved == {
        "worker-1": pytest.approx(whole * 3 / 4, abs=1e-6),
        "worker-2": pytest.approx(whole / 4, abs=1e-6),
    }
    # And a heartbeat does not forget it
    SliceQueue(client, "worker-1", 60).heartbeat(about("worker-1"), ())
    assert {one.id: one.saved_core_hours for one in jobs.workers()} == saved


def test_a_job_that_does_not_converge_and_a_worker_that_left_have_no_share(
    client: redis.Redis,
) -> None:
    here = SliceQueue(client, "worker-1", 60)
    here.heartbeat(about("worker-1"), ())
    for state in (JobState.EXHAUSTED, JobState.CONVERGED):
        job = StagedJob(client, max_spp=1000)
        job.commit(4)
        job.point(100, 0)
        if state is JobState.CONVERGED:
            here.leave()
        job.end(state)
        assert not client.exists(keys.job(job.id, "shares"))
    assert Jobs(client).workers() == []
    here.heartbeat(about("worker-1"), ())
    assert [one.saved_core_hours for one in Jobs(client).workers()] == [0]


@pytest.mark.parametrize("steer", [Workers.drain, Workers.resume])
def test_only_a_living_worker_can_be_told(client: redis.Redis, steer: object) -> None:
    with pytest.raises(WorkerNotFound, match="there is no worker 'nobody'"):
        steer(Workers(client), "nobody")  # type: ignore[operator]
