"""The one asyncio client of Redis: it reads the events of jobs as they happen."""

import asyncio
import logging
from collections.abc import AsyncIterator
from typing import Any, Final

from redis.asyncio import Redis, Sentinel
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from plateau.farm.ledger.records import event
from plateau.farm.model.job import Event
from plateau.farm.process.log import concerning
from plateau.farm.redis import keys
from plateau.farm.redis.link import link_options, open_link

_RETRY_S: Final = 1.0
_GATHER_S: Final = 0.03  #: a wait after a batch: a point, the end and its results come together
#: One for each watcher; redis-py's own limit is 100, that of Redis 10,000.
_CONNECTIONS: Final = 5000

_log = logging.getLogger(__name__)


class EventHub:
    """Events of jobs as they happen, from any point of the past on.

    Each watcher waits in Redis for what comes after its last event: none is lost or sent twice.
    """

    def __init__(self, redis_url: str) -> None:
        options = {
            "retry": Retry(NoBackoff(), 0),  # the methods below try again, and log it
            "max_connections": _CONNECTIONS,
            **link_options(redis_url),
        }
        self._redis: Redis[str] = open_link(redis_url, Redis, Sentinel, options)
        self._reads: set[asyncio.Future[Any]] = set()
        self._closing = False

    async def events(
        self, job_id: str, after: str, *, idle_s: float
    ) -> AsyncIterator[tuple[Event, ...]]:
        """Yield the job's events since the event `after`, in batches, up to `finished`.

        A batch is empty after `idle_s` seconds without news, and while Redis is away. They must be
        fewer than the socket's time-out, so that a quiet job does not look like a dead connection.
        """
        stream, block_ms = keys.job(job_id, "events"), round(idle_s * 1000)
        while not self._closing:
            read = asyncio.ensure_future(self._entries(stream, after, block_ms))
            self._reads.add(read)
            try:
                await asyncio.wait([read])
                if read.cancelled():
                    return
                answer = read.result()
            except (RedisError, OSError) as error:
                with concerning(job_id):
                    _log.warning("its events wait, Redis is away: %s", error)
                yield ()
                await asyncio.sleep(_RETRY_S)
                continue
            finally:
                read.cancel()
                self._reads.discard(read)
            batch = tuple(event(*entry) for _, entries in answer for entry in entries)
            yield batch
            after = batch[-1].id if batch else after
            if any(one.type == "finished" for one in batch):
                return
            await asyncio.sleep(_GATHER_S if batch else 0)

    async def _entries(self, stream: str, after: str, block_ms: int) -> Any:
        # xread's coroutine holds another, which a task cancelled before its start never awaits
        return await self._redis.xread({stream: after}, block=block_ms)

    def stop_watching(self) -> None:
        """End every stream of events, so that a stopping server need not wait for them."""
        self._closing = True
        for read in self._reads:
            read.cancel()

    async def close(self) -> None:
        """End all streams and close the connections."""
        self.stop_watching()
        await self._redis.aclose()
