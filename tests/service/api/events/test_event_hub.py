"""The fan-out of a job's events: who watches misses nothing and costs Redis next to nothing."""

import asyncio
import json
from collections.abc import Awaitable, Callable

import redis

from plateau.farm.redis import keys
from plateau.service.api.events import feed as event_feed
from plateau.service.api.events.feed import Feed, Told
from plateau.service.api.events.hub import EventHub

JOB = "0123456789ab"


def announce(client: redis.Redis, number: int, kind: str = "slice", job: str = JOB) -> str:
    data = json.dumps({"index": number})
    return client.xadd(keys.job(job, "events"), {"type": kind, "at": "1.5", "data": data})


async def all_of(hub: EventHub, after: str = "0-0", job: str = JOB) -> list[Told]:
    batches = [batch async for batch in hub.events(job, after, idle_s=60)]
    assert () not in batches, "Redis was thought to be away"
    return [told for batch in batches for told in batch]


def with_hub(url: str, story: Callable[[EventHub], Awaitable[None]]) -> None:
    async def told() -> None:
        hub = EventHub(url)
        try:
            await asyncio.wait_for(story(hub), 60)
        finally:
            await hub.close()

    asyncio.run(told())


async def caught_up(hub: EventHub, *jobs: str) -> None:
    """Wait until the hub reads what happens to these jobs from now on."""

    def is_read(job: str) -> bool:
        feed = hub._feeds.get(job)
        return feed is not None and feed._complete_since is not None

    while not all(map(is_read, jobs)):
        await asyncio.sleep(0.005)


def reads_of(client: redis.Redis) -> int:
    calls = client.info("commandstats")
    return sum(calls.get(f"cmdstat_{name}", {"calls": 0})["calls"] for name in ("xrange", "xread"))


def test_each_watcher_has_each_event_once_and_in_order(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        # Given a job of which something has happened, and many who watch it
        ids = [announce(client, number) for number in range(3)]
        watching = [asyncio.create_task(all_of(hub)) for _ in range(40)]
        # When more happens, with somebody new coming in between
        for number in range(3, 60):
            ids.append(announce(client, number))
            watching.append(asyncio.create_task(all_of(hub, ids[number % 7])))
            await asyncio.sleep(0)
        ids.append(announce(client, 60, "finished"))
        # Then each has all that came after what it knew
        everything = [event_feed.position(one) for one in ids]
        for number, told in enumerate(await asyncio.gather(*watching)):
            start = 0 if number < 40 else (number - 40 + 3) % 7 + 1
            assert [one.position for one in told] == everything[start:]

    with_hub(redis_url, story)


def test_events_are_read_once_for_all_watchers(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        received: list[Told] = []

        async def watch() -> None:
            async for batch in hub.events(JOB, "0-0", idle_s=30):
                received.extend(batch)

        async def is_told(number: int, kind: str = "slice") -> int:
            """Tell all who watch of something more; returns how often Redis was read for it."""
            before, had = reads_of(client), len(received)
            announce(client, number, kind)
            while len(received) < had + len(watching):
                await asyncio.sleep(0.001)
            return reads_of(client) - before

        # Given many who have caught up with what has happened
        watching = [asyncio.create_task(watch()) for _ in range(50)]
        while await is_told(0) > 1:
            pass
        received.clear()
        # When more happens
        reads = [await is_told(number) for number in range(20)]
        # Then one connection reads it, and waits on; Redis may count a read a moment late, but the
        # fifty would have read fifty times
        assert max(reads) <= 5
        await is_told(20, "finished")
        await asyncio.gather(*watching)
        # And all were told in the same bytes
        assert len({id(one.frame) for one in received}) == 21

    with_hub(redis_url, story)


def test_many_who_come_at_once_share_a_few_connections(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        for number in range(20):
            announce(client, number)
        before = client.info("clients")["connected_clients"]
        watching = [asyncio.create_task(all_of(hub)) for _ in range(300)]
        announce(client, 20, "finished")
        assert {len(told) for told in await asyncio.gather(*watching)} == {21}
        assert client.info("clients")["connected_clients"] - before <= 20

    with_hub(redis_url, story)


def test_many_jobs_are_watched_at_once(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        jobs = [f"{number:012x}" for number in range(150)]
        known = [announce(client, 0, job=job) for job in jobs]
        watching = [asyncio.create_task(all_of(hub, *one)) for one in zip(known, jobs, strict=True)]
        await caught_up(hub, *jobs)
        for job in jobs:
            announce(client, 1, "finished", job)
        assert {len(told) for told in await asyncio.gather(*watching)} == {1}

    with_hub(redis_url, story)


def test_who_is_very_late_reads_for_itself(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        # Given one who takes an event, and another who keeps the feed going
        first = announce(client, 0)
        other = asyncio.create_task(all_of(hub, first))
        slow = hub.events(JOB, "0-0", idle_s=30)
        assert [one.position for one in await anext(slow)] == [event_feed.position(first)]
        await caught_up(hub, JOB)
        # When more happens than is kept, before it takes the next
        ids = [announce(client, number) for number in range(3 * event_feed._KEPT)]
        ids.append(announce(client, 0, "finished"))
        await other
        # Then it has all the same
        told = [one async for batch in slow for one in batch]
        assert [one.position for one in told] == [event_feed.position(one) for one in ids]

    with_hub(redis_url, story)


def test_a_quiet_job_says_that_it_is_there(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        known = announce(client, 0)
        batches = hub.events(JOB, known, idle_s=0.05)
        assert [await anext(batches) for _ in range(3)] == [(), (), ()]
        announce(client, 1, "finished")
        rest = [batch async for batch in batches]
        assert [len(batch) for batch in rest if batch] == [1]

    with_hub(redis_url, story)


def test_other_work_has_its_turn_while_many_are_woken() -> None:
    async def story() -> None:
        feed = Feed()
        await feed.start((0, 0))
        turns = 0

        async def other_work() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        working = asyncio.create_task(other_work())
        watchers = [feed.watcher() for _ in range(200)]
        for watcher in watchers:
            watcher.__enter__()
        before = turns
        await feed.add([Told((1, 0), False, b"")])
        assert turns - before >= 200 // event_feed._WOKEN_AT_ONCE - 1
        working.cancel()

    asyncio.run(story())


def test_a_reader_that_dies_ends_the_streams(redis_url: str, client: redis.Redis) -> None:
    async def story(hub: EventHub) -> None:
        known = announce(client, 0)
        watching = asyncio.create_task(all_of(hub, known))
        await caught_up(hub, JOB)
        client.xadd(keys.job(JOB, "events"), {"type": "slice", "at": "1", "data": "no JSON"})
        (ended,) = await asyncio.gather(watching, return_exceptions=True)
        assert isinstance(ended, json.JSONDecodeError)

    with_hub(redis_url, story)
