"""Whatever becomes of Redis, or of the way to it: what it acknowledged counts, and counts once."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis.link import connect
from tests.support.farms.faulty_farm import FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.long_tests import cases
from tests.support.until import until

Submit = Callable[[], str]

#: A lease of these farms lasts 2 s.
LONGER_THAN_A_LEASE_S = 5.0


def half_way(farm: FaultyFarm, job: str) -> None:
    """Wait until the job is in the middle of its work."""
    until(lambda: farm.jobs.get(job).points >= 3)
    assert not farm.jobs.get(job).state.ended


def troubles(farm: FaultyFarm, job: str) -> list[object]:
    return [one.data["cause"] for one in farm.jobs.events(job) if one.type == "trouble"]


@pytest.fixture
def proxy(farm: FaultyFarm) -> Iterator[RedisProxy]:
    """The way of a monitor and two workers to Redis; the API and the test have their own."""
    with RedisProxy(Path(farm.redis.url.removeprefix("unix://"))) as proxy:
        for role in ("monitor", "worker", "worker"):
            farm.start(role, PLATEAU_REDIS_URL=proxy.url)
        farm.wait_for_workers(2)
        yield proxy
        proxy.heal()
        farm.stop_all()


@pytest.mark.parametrize("away_s", cases([0.0, LONGER_THAN_A_LEASE_S], [LONGER_THAN_A_LEASE_S]))
def test_a_redis_that_is_killed_and_started_again(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit, away_s: float
) -> None:
    farm.start("monitor")
    farm.start("worker")
    job = submit()
    half_way(farm, job)
    before = farm.jobs.get(job)
    farm.redis.process.kill()
    farm.redis.process.wait()
    with pytest.raises(StoreUnavailable):
        farm.jobs.get(job)
    time.sleep(away_s)
    farm.redis.start()
    # What it had acknowledged is there
    after = farm.jobs.get(job)
    assert after.committed_spp >= before.committed_spp
    assert after.points >= before.points
    # And nobody was blamed for what he could not renew
    assert_same(outcome(farm, job), undisturbed)
    assert troubles(farm, job) == []


@pytest.mark.parametrize("mood", cases(["refuse", "silent", "deaf"], ["deaf"]))
def test_a_way_to_redis_that_fails_for_longer_than_a_lease(
    farm: FaultyFarm, proxy: RedisProxy, undisturbed: Outcome, submit: Submit, mood: str
) -> None:
    job = submit()
    half_way(farm, job)
    proxy.fail(mood)
    time.sleep(LONGER_THAN_A_LEASE_S)
    proxy.heal()
    assert_same(outcome(farm, job), undisturbed)
    assert troubles(farm, job) == []
    assert all(process.poll() is None for process in farm.processes)


def test_a_way_to_redis_that_loses_answers_again_and_again(
    farm: FaultyFarm, proxy: RedisProxy, undisturbed: Outcome, submit: Submit
) -> None:
    job = submit()
    for _ in range(12):
        if farm.jobs.get(job).state.ended:
            break
        proxy.fail("deaf")
        time.sleep(0.1)
        proxy.heal()
        time.sleep(0.4)
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize("delay_s", cases([0.02, 0.1, 0.3], [0.02]))
def test_a_slow_way_to_redis(
    farm: FaultyFarm, proxy: RedisProxy, undisturbed: Outcome, submit: Submit, delay_s: float
) -> None:
    proxy.delay_s = delay_s
    assert_same(outcome(farm, submit()), undisturbed)


def test_a_redis_that_is_full_for_a_while(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit
) -> None:
    farm.start("monitor")
    farm.start("worker")
    job = submit()
    half_way(farm, job)
    client = connect(farm.redis.url)
    client.config_set("maxmemory", 1)
    time.sleep(LONGER_THAN_A_LEASE_S)
    client.config_set("maxmemory", 0)
    assert_same(outcome(farm, job), undisturbed)
    assert troubles(farm, job) == []


def test_processes_that_start_before_their_redis(
    farm: FaultyFarm, undisturbed: Outcome, submit: Submit
) -> None:
    job = submit()
    with RedisProxy(Path(farm.redis.url.removeprefix("unix://"))) as proxy:
        proxy.fail("refuse")
        for role in ("monitor", "worker"):
            farm.start(role, PLATEAU_REDIS_URL=proxy.url)
        time.sleep(3)
        proxy.heal()
        assert_same(outcome(farm, job), undisturbed)
        farm.stop_all()
