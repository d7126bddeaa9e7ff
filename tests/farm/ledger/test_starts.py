"""What the queue in Redis tells of the starts of its jobs."""

import pytest
import redis

from plateau.farm.ledger import starts as module
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.ledger.starts import Starts
from plateau.farm.model.job import Job
from plateau.farm.model.starts import TURN_S, Start
from plateau.farm.redis import keys
from tests.farm.ledger.test_workers import about
from tests.support.farms.staged_job import StagedJob
from tests.support.redis.round_trips import round_trips


class Farm:
    """Workers and jobs of one Redis."""

    def __init__(self, client: redis.Redis) -> None:
        self.client = client

    def worker(self, name: str, **more: object) -> None:
        described = {**about(name), "variants": ("scalar_rgb",), **more}
        SliceQueue(self.client, name, 60).heartbeat(described, ())

    def job(self, **spec: object) -> StagedJob:
        return StagedJob(self.client, **spec)

    def now(self, job: StagedJob) -> Job:
        return Jobs(self.client).get(job.id)

    def start(self, job: StagedJob) -> Start | None:
        return Starts(self.client).of([self.now(job)]).get(job.id)

    def leased(self) -> None:
        """A slice is under way."""
        assert SliceQueue(self.client, "worker-1", 60).lease(("scalar_rgb",), None, in_turn=False)

    def cancelled(self, job: StagedJob) -> None:
        Jobs(self.client).cancel(job.id)


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def slice_s(farm: Farm, job: StagedJob) -> float:
    """The mean time of the job's slices."""
    done = farm.now(job)
    return done.machine_s / (done.committed_spp / done.spec.slice_spp)


def test_a_job_starts_after_the_work_of_older_ones(farm: Farm) -> None:
    farm.worker("worker-1")
    first = farm.job(max_spp=1000, slice_spp=25)
    first.commit(4)
    first.plan()
    farm.leased()
    # Two jobs take turns with one worker, and so much of them is before the third
    farm.job(max_spp=500, slice_spp=25, rule={"name": "fixed", "spp": 500})
    third = farm.job(max_spp=1000, slice_spp=25)
    # Without a forecast the first counts to its cap, by the time of its own slices
    start = farm.start(third)
    assert start is not None
    assert start.is_bound
    before_s = 2 * 20 * slice_s(farm, first)
    assert before_s - 0.1 <= start.seconds <= before_s + TURN_S
    # With one, to where it is expected to end
    first.point(100, 50, expected_spp=300)
    start = farm.start(third)
    assert start is not None
    assert not start.is_bound
    before_s = 2 * 8 * slice_s(farm, first)
    assert before_s - 0.1 <= start.seconds <= before_s + TURN_S


def test_nothing_is_said_of_a_job_that_cannot_start(farm: Farm) -> None:
    gpu = farm.job(requires=("gpu",))
    assert farm.start(gpu) is None
    farm.worker("worker-1", trouble="it has no variant")
    farm.worker("worker-2", tags=("gpu",), pool="night")
    assert farm.start(gpu) is None
    farm.worker("worker-3", tags=("gpu",))
    assert farm.start(gpu) == Start(0, is_bound=False)
    blocked = farm.job(requires=("gpu",), blocked=("worker-3",))
    assert farm.start(blocked) is None
    held = farm.job(batch="walk", at_once=1), farm.job(batch="walk", at_once=1)
    assert [one.id in Starts(farm.client).of([farm.now(one)]) for one in held] == [True, False]


def test_a_long_queue_is_read_in_few_round_trips(
    farm: Farm, client: redis.Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    farm.worker("worker-1")
    jobs = [farm.now(farm.job()) for _ in range(60)]
    starts, found = Starts(client), []
    assert round_trips(lambda: found.append(starts.of(jobs))) == 2
    assert [start is not None and start.seconds for start in found[0].values()] == sorted(
        start.seconds for start in found[0].values() if start
    )
    # And what was read serves for a moment
    assert round_trips(lambda: found.append(starts.of(jobs))) == 0
    assert found[0] == found[1]
    # A queue that is too long is not read
    monkeypatch.setattr(module, "MOST_OPEN", 59)
    assert set(Starts(client).of(jobs).values()) == {None}


def test_a_job_of_an_older_plateau_has_its_cap_in_its_spec(farm: Farm, client: redis.Redis) -> None:
    farm.worker("worker-1")
    first, second = farm.job(max_spp=500), farm.job()
    start = farm.start(second)
    client.hdel(keys.job(first.id), "max_spp")
    assert farm.start(second) == start
    # And one that cannot be read is left out
    client.hset(keys.job(first.id), "leased", "many")
    assert farm.start(second) == Start(0, is_bound=False)
