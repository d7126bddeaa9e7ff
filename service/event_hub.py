"""The one asyncio client of Redis: it fans the jobs' event streams out to who watches them."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field
from typing import Final

from redis.asyncio import Redis
from redis.exceptions import RedisError

from farm import keys
from farm.job import Event
from farm.log import concerning
from farm.records import event

#: Shorter than the socket's time-out, so that a quiet job is not taken for a dead connection.
_BLOCK_MS: Final = 5000
_SOCKET_TIMEOUT_S: Final = 10.0
_RETRY_S: Final = 1.0

_log = logging.getLogger(__name__)


@dataclass(eq=False)
class _Feed:
    """A job that somebody watches: one blocking read in Redis wakes all its watchers."""

    news: set[asyncio.Event] = field(default_factory=set)
    reader: "asyncio.Task[None] | None" = None


class EventHub:
    """Events of jobs as they happen, from any point of the past on.

    However many watch a job, one connection waits for it; each watcher then reads on from its
    own last event, so that none is lost or sent twice, through outages of Redis too.
    """

    def __init__(self, redis_url: str) -> None:
        self._redis: Redis[str] = Redis.from_url(
            redis_url,
            decode_responses=True,
            protocol=2,
            socket_timeout=_SOCKET_TIMEOUT_S,
            socket_connect_timeout=5.0,
        )
        self._feeds: dict[str, _Feed] = {}
        self._closing = False

    async def events(
        self, job_id: str, after: str, *, idle_s: float
    ) -> AsyncIterator[tuple[Event, ...]]:
        """The job's events since the event `after`, in batches, up to and including `finished`.

        An empty batch comes after `idle_s` seconds without news, and when Redis is away.
        """
        with self._watching(job_id, after) as news:
            while not self._closing:
                news.clear()
                try:
                    batch = await self._read(job_id, after)
                except (RedisError, OSError) as error:
                    with concerning(job_id):
                        _log.warning("its events wait, Redis is away: %s", error)
                    yield ()
                    await asyncio.sleep(_RETRY_S)
                    continue
                if batch:
                    yield batch
                    after = batch[-1].id
                    if any(happening.type == "finished" for happening in batch):
                        return
                    continue
                try:
                    await asyncio.wait_for(news.wait(), idle_s)
                except asyncio.TimeoutError:
                    yield ()

    def stop_watching(self) -> None:
        """End every stream of events, so that the server need not wait for its clients."""
        self._closing = True
        for feed in self._feeds.values():
            _wake(feed)

    async def close(self) -> None:
        """Give the connections back."""
        self.stop_watching()
        readers = [feed.reader for feed in self._feeds.values() if feed.reader is not None]
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
        await self._redis.aclose()

    async def _read(self, job_id: str, after: str) -> tuple[Event, ...]:
        entries = await self._redis.xrange(keys.job(job_id, "events"), min=f"({after}")
        return tuple(event(event_id, fields) for event_id, fields in entries)

    @contextlib.contextmanager
    def _watching(self, job_id: str, after: str) -> Iterator[asyncio.Event]:
        feed = self._feeds.setdefault(job_id, _Feed())
        if feed.reader is None:
            feed.reader = asyncio.create_task(self._wait_for_news(job_id, feed, after))
        news = asyncio.Event()
        feed.news.add(news)
        try:
            yield news
        finally:
            feed.news.discard(news)
            if not feed.news:
                feed.reader.cancel()
                del self._feeds[job_id]

    async def _wait_for_news(self, job_id: str, feed: _Feed, after: str) -> None:
        stream = keys.job(job_id, "events")
        while True:
            try:
                answer = await self._redis.xread({stream: after}, block=_BLOCK_MS)
            except (RedisError, OSError):
                await asyncio.sleep(_RETRY_S)
                continue
            for _, entries in answer:
                after = entries[-1][0]
                _wake(feed)


def _wake(feed: _Feed) -> None:
    for news in feed.news:
        news.set()
