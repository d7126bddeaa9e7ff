"""Every write may be repeated: where only its answer was lost, the state is as if done once.

Each is done over a connection that breaks after the write and before its answer. Its caller sees
an error, and does it again.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest
import redis

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.redis.lost_answers import CASES, NOTICE, REPEATS_DIFFER, World, written_by
from tests.support.redis.redis_commands import commands

#: What differs by the time that passes between two looks.
_CLOCKS: Final = {"seen_at", "at", "swept at", "next_sweep_at"}
_SCORED_BY_TIME: Final = {keys.WORKERS, keys.MONITORS, keys.LEASES, keys.SCENES_USED, keys.NOTICES}
_TIMES: Final = {keys.HEARD, keys.API_KEYS_USED}


@pytest.fixture
def proxy(embedded_redis: EmbeddedRedis, redis_url: str) -> Iterator[RedisProxy]:
    with RedisProxy(Path(redis_url.removeprefix("unix://"))) as proxy:
        yield proxy


@pytest.fixture
def world(client: redis.Redis, proxy: RedisProxy) -> Iterator[World]:
    lossy = connect(proxy.url, 120.0)
    yield World(client, lossy)
    lossy.close()


def state(client: redis.Redis) -> dict[str, Any]:
    """All that Redis holds, without what time changes by itself."""
    found: dict[str, Any] = {}
    for key in sorted(client.scan_iter(count=1000)):
        if key in _TIMES:
            continue
        kind = client.type(key)
        if kind == "string":
            found[key] = client.get(key)
        elif kind == "hash":
            fields = client.hgetall(key)
            found[key] = {name: fields[name] for name in fields if name not in _CLOCKS}
        elif kind == "set":
            found[key] = client.smembers(key)
        elif kind == "zset":
            scored = client.zrange(key, 0, -1, withscores=True)
            timed = key in _SCORED_BY_TIME or key.startswith(f"{keys.NOTICES}:")
            found[key] = {member: None if timed else score for member, score in scored}
        else:
            groups = client.xinfo_groups(key)
            found[key] = (
                client.xrange(key),
                [
                    (one["message_id"], one["consumer"], one["times_delivered"])
                    for _ in groups
                    for one in client.xpending_range(key, keys.GROUP, "-", "+", 1000)
                ],
            )
    return found


def do_and_lose_the_answer(
    world: World, proxy: RedisProxy, write: Callable[[], object], answers_before: int = 0
) -> None:
    world.lossy.ping()  # so that the connection is there, and the write the next thing on it
    proxy.answers_before = answers_before
    proxy.fail("forgetful")
    with pytest.raises(StoreUnavailable):
        write()
    assert proxy.mood == "through"


@pytest.mark.parametrize("name", CASES)
def test_a_write_whose_answer_was_lost_may_be_repeated(
    client: redis.Redis, world: World, proxy: RedisProxy, name: str
) -> None:
    world.load_scripts()
    case = CASES[name]
    prepared = case.prepare(world)
    before = state(client)

    def write() -> object:
        return case.write(world, prepared)

    do_and_lose_the_answer(world, proxy, write, case.answers_before)
    once = state(client)
    assert once != before or case.writes_only_times
    # When the caller does it again
    try:
        answer: object = write()
    except Exception as error:  # noqa: BLE001  (each case says which)
        answer = type(error)
    assert case.is_answered(answer)
    # Then all is as it was after the first time
    assert state(client) == once


def test_each_command_that_writes_has_its_case() -> None:
    tested = {written_by(name) for name in CASES} | REPEATS_DIFFER
    assert commands() <= tested


# Those that do more when repeated: what the first one did comes back by itself.


def test_a_lease_of_which_nobody_heard_comes_back_and_kills_nobody(
    client: redis.Redis, world: World, proxy: RedisProxy
) -> None:
    world.load_scripts()
    job = world.job(slices=1)
    do_and_lose_the_answer(world, proxy, lambda: world.lease(lease_s=1.0))
    # When the worker lives on without it, for as long as a lease lasts
    again = None
    while again is None:
        world.heartbeat()
        again = world.lease(lease_s=1.0)
    assert again.index == 0
    assert [one.type for one in world.jobs.events(job) if one.type == "trouble"] == []


def test_a_job_that_was_taken_by_nobody_is_free_again_soon(
    client: redis.Redis, world: World, proxy: RedisProxy
) -> None:
    world.load_scripts()
    job = world.job(owned=False)
    do_and_lose_the_answer(world, proxy, lambda: world.acquire(job, lease_s=0.05))
    while (owned := world.acquire(job, lease_s=0.05)) is None:
        pass
    assert owned.token == "2"


def test_a_notice_that_was_taken_by_nobody_is_sent_by_another_try(
    client: redis.Redis, world: World, proxy: RedisProxy
) -> None:
    world.load_scripts()
    world.finished(notice=NOTICE)
    do_and_lose_the_answer(world, proxy, lambda: world.outbox.take(0.05))
    while (taken := world.outbox.take(0.05)) is None:
        pass
    assert taken.tries == 2
