"""The connection to Redis: no silent retries, and one error when it is away."""

from collections.abc import Iterator
from contextlib import contextmanager

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from farm.errors import StoreUnavailable

#: Longer than any blocking read, so that none is taken for a dead connection.
SOCKET_TIMEOUT_S = 10.0


def connect(url: str) -> redis.Redis:
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


@contextmanager
def unavailable_as_farm_error() -> Iterator[None]:
    """Raise `StoreUnavailable` where redis-py raises because Redis is away, loading or full."""
    away = (
        redis.exceptions.ConnectionError,
        redis.exceptions.TimeoutError,
        redis.exceptions.BusyLoadingError,
        redis.exceptions.OutOfMemoryError,
        redis.exceptions.ReadOnlyError,
    )
    try:
        yield
    except away as error:
        raise StoreUnavailable(f"Redis cannot be reached: {error}") from error
