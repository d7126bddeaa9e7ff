"""The one asyncio client of Redis: it fans the jobs' event streams out to their watchers."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Iterator
from typing import Final

from redis.asyncio import Redis, Sentinel
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from plateau.farm.ledger.records import event
from plateau.farm.process.log import concerning
from plateau.farm.redis import keys
from plateau.farm.redis.link import link_options, open_link
from plateau.service.api.events.feed import Feed, Told, position

#: Shorter than the socket's time-out, so that a quiet job does not look like a dead connection.
_BLOCK_MS: Final = 5000
_RETRY_S: Final = 1.0
#: One for each watched job; redis-py's own limit is 100, that of Redis 10,000.
_CONNECTIONS: Final = 5000
#: Watchers that read a job's past at once, each over its own connection; the others wait.
_READERS_OF_THE_PAST: Final = 16

_log = logging.getLogger(__name__)


class EventHub:
    """Events of jobs as they happen, from any point of the past on.

    One connection reads a job's news for all its watchers. A new watcher first reads the events
    since its own last one. So no event is lost or sent twice, even through outages of Redis.
    """

    def __init__(self, redis_url: str) -> None:
        options = {
            "retry": Retry(NoBackoff(), 0),  # the methods below try again, and log it
            "max_connections": _CONNECTIONS,
            **link_options(redis_url),
        }
        self._redis: Redis[str] = open_link(redis_url, Redis, Sentinel, options)
        self._reading_the_past = asyncio.Semaphore(_READERS_OF_THE_PAST)
        self._feeds: dict[str, Feed] = {}
        self._closing = False

    async def events(
        self, job_id: str, after: str, *, idle_s: float
    ) -> AsyncIterator[tuple[Told, ...]]:
        """Yield the job's events since the event `after`, in batches, up to `finished`.

        A batch is empty after `idle_s` seconds without news, and while Redis is away.
        """
        known = position(after)
        with self._feed(job_id) as feed, feed.watcher() as watcher:
            while not self._closing:
                feed.check()
                watcher.has_seen_all()
                batch = feed.since(known)
                if batch is None:  # the feed does not reach back so far
                    try:
                        batch = await self._read(job_id, known)
                    except (RedisError, OSError) as error:
                        with concerning(job_id):
                            _log.warning("its events wait, Redis is away: %s", error)
                        yield ()
                        await asyncio.sleep(_RETRY_S)
                        continue
                if batch:
                    yield batch
                    known = batch[-1].position
                    if any(one.is_last for one in batch):
                        return
                elif not await watcher.has_news(within_s=idle_s):
                    yield ()

    def stop_watching(self) -> None:
        """End every stream of events, so that a stopping server need not wait for them."""
        self._closing = True
        for feed in self._feeds.values():
            feed.wake_all()

    async def close(self) -> None:
        """End all streams and close the connections."""
        self.stop_watching()
        await asyncio.gather(
            *(feed.stop() for feed in self._feeds.values()), return_exceptions=True
        )
        await self._redis.aclose()

    async def _read(self, job_id: str, known: tuple[int, int]) -> tuple[Told, ...]:
        first = f"({known[0]}-{known[1]}"
        async with self._reading_the_past:
            entries = await self._redis.xrange(keys.job(job_id, "events"), min=first)
        return tuple(Told.of(event(*entry)) for entry in entries)

    @contextlib.contextmanager
    def _feed(self, job_id: str) -> Iterator[Feed]:
        feed = self._feeds.get(job_id)
        if feed is None:
            feed = self._feeds[job_id] = Feed()
            feed.read_by(asyncio.create_task(self._keep_up(job_id, feed)))
        try:
            yield feed
        finally:
            if not feed.is_watched:
                feed.stop()
                del self._feeds[job_id]

    async def _keep_up(self, job_id: str, feed: Feed) -> None:
        stream, newest = keys.job(job_id, "events"), None
        while True:
            try:
                if newest is None:
                    entries = await self._redis.xrevrange(stream, count=1)
                    newest = entries[0][0] if entries else "0-0"
                    # A watcher that read Redis before this may have missed later events.
                    await feed.start(position(newest))
                answer = await self._redis.xread({stream: newest}, block=_BLOCK_MS)
            except (RedisError, OSError):
                await asyncio.sleep(_RETRY_S)
                continue
            for _, entries in answer:
                newest = entries[-1][0]
                await feed.add([Told.of(event(*entry)) for entry in entries])
