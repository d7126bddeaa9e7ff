"""Keys share the workers of a farm, whatever each has sent."""

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import Lease, SliceQueue
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
LIMITS = KeyLimits(requests_per_minute=1000, burst=100, upload_bytes=None, open_jobs=None)


class Farm:
    """One Redis with jobs of several keys, and any number of workers."""

    def __init__(self, client: redis.Redis) -> None:
        self._client = client
        self.keys = ApiKeys(client)
        self.jobs = Jobs(client)
        self.owners = Ownerships(client, lease_s=15)
        self._workers = 0

    def key(self, name: str) -> str:
        return self.keys.create(name, Role.SUBMITTER, LIMITS)[0].id

    def job(self, owner: str = "", slices: int = 4, **spec: object) -> Job:
        job = self.jobs.create(JobSpec(**spec), name="box", scene_sha256="00", owner=owner).job
        owned = self.owners.acquire(job.id)
        assert owned is not None
        self.owners.plan(owned, range(slices))
        return job

    def lease(self, loaded: str | None = None, *, in_turn: bool = False) -> Lease:
        """What another worker is given."""
        self._workers += 1
        worker = SliceQueue(self._client, f"worker-{self._workers}", lease_s=15)
        found = worker.lease(VARIANTS, loaded, in_turn=in_turn)
        assert found is not None
        return found

    def give(self, count: int) -> list[str]:
        """The jobs whose slices the next workers are given."""
        return [self.lease().job_id for _ in range(count)]


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def test_a_key_gets_no_more_by_sending_more_jobs(farm: Farm) -> None:
    many, one = farm.key("many"), farm.key("one")
    crowd = [farm.job(many) for _ in range(5)]
    single = farm.job(one, slices=8)
    # Without shares for keys, the single job would be given every sixth slice
    given = farm.give(8)
    assert given.count(single.id) == 4
    # Within the crowd's share its jobs take turns, the oldest first
    assert [job for job in given if job != single.id] == [job.id for job in crowd[:4]]


def test_jobs_of_nobody_are_one_owner_s(farm: Farm) -> None:
    nobodys = [farm.job() for _ in range(3)]
    mine = farm.job(farm.key("me"))
    assert farm.give(4) == [nobodys[0].id, mine.id, nobodys[1].id, mine.id]


def test_what_counts_is_samples_not_slices(farm: Farm) -> None:
    large = farm.job(farm.key("large"), slice_spp=100)
    small = farm.job(farm.key("small"), slice_spp=25, slices=8)
    assert farm.give(6) == [large.id, *[small.id] * 4, large.id]


def test_a_higher_priority_goes_before_any_share(farm: Farm) -> None:
    busy, idle = farm.key("busy"), farm.key("idle")
    urgent = farm.job(busy, slices=3, priority=5)
    farm.job(busy)
    other = farm.job(idle)
    assert farm.give(3) == [urgent.id] * 3
    # And what the key has leased there counts against it below
    assert farm.give(3) == [other.id] * 3


def test_jobs_that_have_nothing_to_give_count_for_their_key_too(farm: Farm) -> None:
    mine, yours = farm.key("mine"), farm.key("yours")
    full = farm.job(mine, slices=2)
    assert farm.give(2) == [full.id] * 2
    paused = farm.job(yours, slices=3)
    assert farm.give(1) == [paused.id]
    farm.jobs.pause(paused.id)
    # Mine has two slices leased by now, yours has one, though neither job gives any more
    second, third = farm.job(mine), farm.job(yours)
    assert farm.give(3) == [third.id, second.id, third.id]


def test_a_worker_keeps_to_its_scene_all_the_same(farm: Farm) -> None:
    mine = farm.job(farm.key("mine"))
    yours = farm.job(farm.key("yours"))
    assert farm.lease().job_id == mine.id
    assert farm.lease(mine.id, in_turn=True).job_id == mine.id
    assert farm.lease(mine.id, in_turn=False).job_id == yours.id


def test_two_keys_may_call_their_batches_the_same(farm: Farm) -> None:
    mine, yours = farm.key("mine"), farm.key("yours")
    theirs = farm.job(yours, batch="b", slices=1)
    batch, single = farm.job(mine, batch="b"), farm.job(mine)
    # What is leased of theirs does not count against mine of the same name
    assert farm.give(3) == [theirs.id, batch.id, single.id]
