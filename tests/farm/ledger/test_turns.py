"""Limits on the jobs that are rendered at once, of an API key and of a batch."""

import pytest
import redis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from plateau.farm.ledger.api_keys import ApiKeys, KeyLimits, Role
from plateau.farm.model.fit import waits_for
from plateau.farm.model.job import Job
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.farm.redis import keys
from tests.farm.ledger.test_after import Farm as _Farm
from tests.farm.ledger.test_waiting import quick as quick
from tests.support.long_tests import WANTED

DONE = JobState.CONVERGED


class Farm(_Farm):
    """Jobs of batches and keys, some of which have a turn."""

    def key(self, most: int) -> str:
        limits = KeyLimits(
            requests_per_minute=1, burst=1, upload_bytes=None, open_jobs=None, jobs_at_once=most
        )
        return ApiKeys(self.client).create("nightly", Role.SUBMITTER, limits)[0].id

    def has_turn(self, job: Job) -> bool:
        found = self.jobs.get(job.id)
        assert (waits_for(found, 0) == found.reason) == found.awaits_turn
        return not found.awaits_turn


@pytest.fixture
def farm(client: redis.Redis) -> Farm:
    return Farm(client)


def nothing_is_left(client: redis.Redis) -> bool:
    return not client.keys(f"{keys.PREFIX}turns:*") and not client.keys(f"{keys.PREFIX}job:*:turns")


def test_jobs_of_a_batch_have_their_turns(farm: Farm) -> None:
    jobs = [farm.job(batch="walk", at_once=2) for _ in range(4)]
    assert [farm.has_turn(job) for job in jobs] == [True, True, False, False]
    words = "waits for its turn: of its batch, at most 2 may be rendered at once"
    assert farm.reason(jobs[2]) == words
    # Their slices are nobody's, and no demand
    assert {farm.given() for _ in range(5)} == {jobs[0].id, jobs[1].id, ""}
    assert farm.jobs.census().demand_for().waiting == 0
    # One that has ended gives its turn back when its results are written
    farm.ends(jobs[0], DONE, finishes=False)
    assert not farm.has_turn(jobs[2])
    farm.finishes(jobs[0])
    assert [farm.has_turn(job) for job in jobs[1:]] == [True, True, False]
    assert farm.jobs.story(jobs[2].id)[-1].endswith("queued: it is its turn")
    assert farm.given() == jobs[2].id
    # Others are not limited
    assert farm.has_turn(farm.job(batch="walk"))
    for job in jobs[1:]:
        farm.ends(job, DONE)
    assert nothing_is_left(farm.client)


def test_higher_priorities_come_first_and_who_is_cancelled_waits_no_more(farm: Farm) -> None:
    first = farm.job(batch="walk", at_once=1)
    low, gone, late, high = (
        farm.job(batch="walk", at_once=1, priority=priority) for priority in (0, 9, 0, 5)
    )
    farm.jobs.cancel(gone.id)
    farm.jobs.set_priority(late.id, 7)
    order = []
    now = first
    for _ in range(3):
        farm.ends(now, JobState.FAILED)
        [now] = [job for job in (low, late, high) if farm.has_turn(job) and job.id not in order]
        order.append(now.id)
    assert order == [late.id, high.id, low.id]


def test_a_key_and_a_batch_limit_a_job_together(farm: Farm) -> None:
    key = farm.key(2)

    def job(batch: str | None, *after: str) -> Job:
        spec = JobSpec(batch=batch, at_once=batch and 1, after=after)
        made = farm.jobs.create(spec, name="box", scene_sha256="00", owner=key).job
        owned = farm.owners.acquire(made.id)
        assert owned is not None
        farm.owners.plan(owned, range(2))
        farm.owners.disown([owned])
        return made

    one, two, three, four = job("a"), job("a"), job("b"), job(None)
    assert [farm.has_turn(each) for each in (one, two, three, four)] == [True, False, True, False]
    assert "of its key, at most 2 may be rendered at once" in farm.reason(four)
    # A job that comes after others takes no turn meanwhile
    after = job(None, three.id)
    farm.ends(three, DONE)
    assert [farm.has_turn(each) for each in (two, four)] == [False, True]
    assert "waits for its turn" in farm.reason(after)
    farm.ends(one, DONE)
    assert [farm.has_turn(each) for each in (two, after)] == [True, False]
    farm.ends(two, DONE)
    assert farm.has_turn(after)
    for each in (four, after):
        farm.ends(each, DONE)
    assert nothing_is_left(farm.client)


def test_one_that_redis_has_lost_gives_its_turn_back(farm: Farm) -> None:
    lost, waiting = (farm.job(batch="walk", at_once=1) for _ in range(2))
    owned = farm.owners.acquire(lost.id)
    assert owned is not None
    farm.client.delete(keys.job(lost.id))
    farm.owners.abandon(owned)
    assert farm.has_turn(waiting)
    assert farm.given() == waiting.id


def test_a_limit_is_that_of_a_batch() -> None:
    with pytest.raises(ValidationError, match="at_once limits a batch"):
        JobSpec(at_once=3)


HISTORIES = st.lists(st.tuples(st.booleans(), st.integers(0, 2**16)), min_size=10, max_size=20)


@settings(
    max_examples=1000 if WANTED else 12,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(HISTORIES)
def test_no_more_than_the_limit_and_none_waits_for_nothing(
    quick: redis.Redis, events: list[tuple[bool, int]]
) -> None:
    quick.flushall()
    farm = Farm(quick)
    owners = {"": 99, farm.key(3): 3}
    jobs: list[Job] = []
    for makes, number in events:
        unfinished = [job for job in jobs if quick.sismember(keys.UNFINISHED, job.id)]
        if makes or not unfinished:
            batch = (None, "one", "two")[number % 3]
            spec = JobSpec(batch=batch, at_once=batch and 2, priority=number // 3 % 3)
            owner = sorted(owners)[number // 9 % 2]
            job = farm.jobs.create(spec, name="box", scene_sha256="00", owner=owner).job
            jobs.append(job)
        else:
            job = unfinished[number % len(unfinished)]
            farm.jobs.cancel(job.id)
            farm.finishes(job)
        now = [farm.jobs.get(one.id) for one in jobs if quick.sismember(keys.UNFINISHED, one.id)]
        having = [one for one in now if not one.awaits_turn]

        def full(one: Job) -> bool:
            batch, owner = one.spec.batch, one.owner or ""
            in_batch = sum(other.spec.batch == batch for other in having)  # noqa: B023
            of_owner = sum((other.owner or "") == owner for other in having)  # noqa: B023
            assert of_owner <= owners[owner]
            assert batch is None or in_batch <= 2
            return of_owner == owners[owner] or (batch is not None and in_batch == 2)

        assert all(full(one) or not one.awaits_turn for one in now)
    for job in jobs:
        if quick.sismember(keys.UNFINISHED, job.id):
            farm.jobs.cancel(job.id)
            farm.finishes(job)
    assert nothing_is_left(quick)
