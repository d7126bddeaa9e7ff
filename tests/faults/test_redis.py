"""Whatever becomes of Redis, or of the way to it: what it acknowledged counts, and counts once."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis.link import connect
from tests.support.farms.faulty_farm import BRIEF, FaultyFarm
from tests.support.faults.invariants import Outcome, assert_same, outcome
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.long_tests import cases
from tests.support.until import until

Submit = Callable[[], str]

#: A lease of these farms lasts 2 s, and of the far one 6 s, so that a busy machine is forgiven.
LONGER_THAN_A_LEASE_S = 4.5
LONGER_THAN_A_FAR_LEASE_S = 8.0


def troubles(farm: FaultyFarm, job: str) -> list[object]:
    return [one.data["cause"] for one in farm.jobs.events(job) if one.type == "trouble"]


@dataclass(frozen=True)
class Remote:
    """A farm, and the way of its monitor and of its worker to Redis.

    The API and the test have their own.
    """

    farm: FaultyFarm
    proxy: RedisProxy


@pytest.fixture(scope="module")
def far_farm(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Iterator[Remote]:
    with (
        FaultyFarm(tmp_path_factory.mktemp("far"), cache, PLATEAU_LEASE_S="6") as farm,
        RedisProxy(Path(farm.redis.url.removeprefix("unix://"))) as proxy,
    ):
        for role in ("monitor", "worker"):
            farm.start(role, PLATEAU_REDIS_URL=proxy.url)
        farm.wait_for_workers(1)
        yield Remote(farm, proxy)
        farm.stop_all()


@pytest.fixture
def remote(far_farm: Remote) -> Iterator[Remote]:
    """The same, whose way is as it should be, before and after."""
    yield far_farm
    far_farm.proxy.delay_s = 0.0
    far_farm.proxy.heal()


@pytest.mark.parametrize("away_s", cases([0.0, LONGER_THAN_A_LEASE_S], [LONGER_THAN_A_LEASE_S]))
def test_a_redis_that_is_killed_and_started_again(
    farm: FaultyFarm, undisturbed: Outcome, away_s: float
) -> None:
    farm.start("monitor")
    farm.start("worker")
    job = farm.submit_half_way(**BRIEF)
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
    remote: Remote, undisturbed: Outcome, mood: str
) -> None:
    farm, proxy = remote.farm, remote.proxy
    job = farm.submit_half_way(**BRIEF)
    proxy.fail(mood)
    time.sleep(LONGER_THAN_A_FAR_LEASE_S)
    proxy.heal()
    assert_same(outcome(farm, job), undisturbed)
    assert troubles(farm, job) == []
    assert all(process.poll() is None for process in farm.processes)


@pytest.mark.long
def test_a_way_to_redis_that_loses_answers_again_and_again(
    remote: Remote, undisturbed: Outcome
) -> None:
    farm, proxy = remote.farm, remote.proxy
    job = farm.submit(**BRIEF).id
    for _ in range(12):
        if farm.jobs.get(job).state.ended:
            break
        proxy.fail("deaf")
        time.sleep(0.1)
        proxy.heal()
        time.sleep(0.4)
    assert_same(outcome(farm, job), undisturbed)


@pytest.mark.parametrize("delay_s", cases([0.02, 0.1, 0.3], [0.02]))
@pytest.mark.long
def test_a_slow_way_to_redis(remote: Remote, undisturbed: Outcome, delay_s: float) -> None:
    remote.proxy.delay_s = delay_s
    job = remote.farm.submit(**BRIEF).id
    assert_same(outcome(remote.farm, job), undisturbed)


@pytest.mark.long
def test_a_redis_that_is_full_for_a_while(farm: FaultyFarm, undisturbed: Outcome) -> None:
    farm.start("monitor")
    farm.start("worker")
    job = farm.submit_half_way(**BRIEF)
    client = connect(farm.redis.url, 120.0)
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
        until(lambda: proxy.refused >= 4, 60, lambda: "nobody tried to reach Redis")
        proxy.heal()
        assert_same(outcome(farm, job), undisturbed)
        farm.stop_all()
