"""A job's events reach whoever watches it: each once, and in order."""

import asyncio
import json
from collections.abc import Awaitable, Callable

import redis

from plateau.farm.redis import keys
from plateau.service.api.event_hub import EventHub

JOB = "0123456789ab"


def announce(client: redis.Redis, number: int, kind: str = "slice") -> str:
    data = json.dumps({"index": number})
    return client.xadd(keys.job(JOB, "events"), {"type": kind, "at": "1.5", "data": data})


async def all_of(hub: EventHub, after: str = "0-0") -> list[str]:
    batches = [batch async for batch in hub.events(JOB, after, idle_s=5)]
    return [event.id for batch in batches for event in batch]


def with_hub(url: str, story: Callable[[EventHub], Awaitable[None]]) -> None:
    async def told() -> None:
        hub = EventHub(url)
        try:
            await asyncio.wait_for(story(hub), 60)
        finally:
            await hub.close()

    asyncio.run(told())


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
        for number, told in enumerate(await asyncio.gather(*watching)):
            start = 0 if number < 40 else (number - 40 + 3) % 7 + 1
            assert told == ids[start:]

    with_hub(redis_url, story)


def test_a_watcher_is_told_to_stop_before_it_has_asked(redis_url: str) -> None:
    async def story(hub: EventHub) -> None:
        watching = asyncio.create_task(all_of(hub))
        await asyncio.sleep(0)  # its question to Redis is due next
        hub.stop_watching()
        assert await watching == []

    with_hub(redis_url, story)
