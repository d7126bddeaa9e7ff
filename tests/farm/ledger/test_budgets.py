"""Budgets of core hours: of a batch, of a single job, and of an API key in a week."""

import pytest
import redis

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import keys

WEEK_MS = 7 * 86_400_000


class Farm:
    """Jobs whose slices cost half a core hour: a quarter of an hour on two threads."""

    def __init__(self, client: redis.Redis) -> None:
        self.client, self.jobs = client, Jobs(client)
        self.owners = Ownerships(client, lease_s=60)
        self.worker = SliceQueue(client, "w", 60, threads=2)

    def job(self, owner: str = "", **spec: object) -> Job:
        job = self.jobs.create(
            JobSpec.model_validate(spec), name="box", scene_sha256="00", owner=owner
        ).job
        owned = self.owners.acquire(job.id)
        assert owned is not None
        self.owners.plan(owned, range(4))
        self.owners.disown([owned])
        return job

    def spend(self, job: Job) -> None:
        """A worker tries one of the job's slices for a quarter of an hour."""
        lease = self.worker.lease(("scalar_rgb",), job.id, in_turn=True)
        assert lease is not None
        assert lease.job_id == job.id
        self.worker.hand_back(lease, 900.0, cause="it stops")

    def used(self, *jobs: Job) -> list[str]:
        return [self.jobs.budget_used(job.id) for job in jobs]

    def key(self, core_hours: float) -> str:
        limits = KeyLimits(
            requests_per_minute=1,
            burst=1,
            upload_bytes=None,
            open_jobs=None,
            core_hours_per_week=core_hours,
        )
        return ApiKeys(self.client).create("nightly", Role.SUBMITTER, limits)[0].id


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def test_the_jobs_of_a_batch_share_theirs(farm: Farm) -> None:
    without = farm.job(batch="walk", priority=1)
    farm.spend(without)
    farm.jobs.cancel(without.id)
    one = farm.job(batch="walk", budget_core_hours=1.0)
    other = farm.job(batch="walk", budget_core_hours=1.5)
    assert [job.has_budget for job in (without, one, other)] == [False, True, True]
    farm.spend(one)
    assert farm.used(one, other) == ["", ""]
    farm.spend(one)
    assert farm.used(one, other, without) == ["its batch's budget of 1 core hours", "", ""]


def test_a_single_job_has_its_own(farm: Farm) -> None:
    job = farm.job(budget_core_hours=0.5)
    assert farm.used(job) == [""]
    farm.spend(job)
    assert farm.used(job) == ["its budget of 0.5 core hours"]
    assert not farm.client.exists(keys.SPENT)


def test_a_key_has_one_for_each_week(farm: Farm) -> None:
    owner = farm.key(0.75)
    first = farm.job(owner)
    farm.spend(first)
    assert farm.used(first) == [""]
    farm.spend(first)
    second = farm.job(owner, batch="walk")
    assert farm.used(first, second) == ["its key's budget of 0.75 core hours a week"] * 2
    assert farm.used(farm.job(farm.key(0.75))) == [""]
    # In the next week it is another sum, and the last one is forgotten
    (field,) = farm.client.hkeys(keys.SPENT)
    group, _, week = field.rpartition(" ")
    now_ms = farm.jobs.now_ms()
    assert int(week) == (now_ms - 4 * WEEK_MS / 7) // WEEK_MS
    farm.client.hset(keys.SPENT, f"{group} {int(week) - 1}", farm.client.hget(keys.SPENT, field))
    farm.client.hdel(keys.SPENT, field)
    assert farm.used(first) == [""]
    farm.spend(first)
    assert farm.client.hkeys(keys.SPENT) == [field]
