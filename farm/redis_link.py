"""The connection to Redis: no silent retries, and one error when it is away."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, TypeAlias

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from farm.errors import StoreUnavailable

#: Longer than any blocking read, so that none is taken for a dead connection.
SOCKET_TIMEOUT_S = 10.0

#: What `connect` returns, for those who hand it on.
RedisClient: TypeAlias = redis.Redis


def connect(url: str) -> RedisClient:
    """A client of the Redis at `url` that never sends a command twice by itself.

    redis-py retries ten times by default; a write whose answer was lost would then be stored
    twice. Here an error reaches the caller, who knows what may be repeated.
    """
    return redis.Redis.from_url(
        url,
        decode_responses=True,
        protocol=2,
        retry=Retry(NoBackoff(), 0),
        socket_timeout=SOCKET_TIMEOUT_S,
        socket_connect_timeout=5.0,
    )


def now_ms(client: RedisClient) -> int:
    """Redis's clock in milliseconds: the only one that counts."""
    seconds, microseconds = client.time()
    return int(seconds) * 1000 + int(microseconds) // 1000


_AWAY: Final = (
    redis.exceptions.ConnectionError,
    redis.exceptions.TimeoutError,
    redis.exceptions.OutOfMemoryError,
    redis.exceptions.ReadOnlyError,
)
#: What Redis answers while it is full, loading, failing over, or cannot write to its disk. Inside a
#: script the words stand somewhere in a longer message.
_REFUSES: Final = re.compile(
    r"\b(OOM|MISCONF|LOADING|BUSY|READONLY|MASTERDOWN|NOREPLICAS|TRYAGAIN|CLUSTERDOWN)\b"
)


@contextmanager
def unavailable_as_farm_error() -> Iterator[None]:
    """Raise `StoreUnavailable` where redis-py raises because Redis is away or refuses for now."""
    try:
        yield
    except _AWAY as error:
        raise StoreUnavailable(f"Redis cannot be reached: {error}") from error
    except redis.exceptions.ResponseError as error:
        if _REFUSES.search(str(error)) is None:
            raise
        raise StoreUnavailable(f"Redis refuses: {error}") from error
