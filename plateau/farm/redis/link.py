"""The connection to Redis: no silent retries, and one error when it is away."""

import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from plateau.farm.model.errors import NotPermitted, StoreUnavailable, WrongPassword
from plateau.farm.redis import url as redis_url
from plateau.farm.redis.client import RedisClient

#: Longer than any blocking read, so that none looks like a dead connection.
SOCKET_TIMEOUT_S = 10.0
_CONNECT_S: Final = 5.0
#: A sentinel answers at once, or another one is asked.
_SENTINEL_S: Final = 2.0

#: A quiet connection is probed, and given up after 10 s of silence: a network may fail without an
#: error. For the same time the kernel tries to deliver what was sent, even after a close: Redis may
#: still run a command that its caller has given up. Platforms lack some of these.
_SILENCE: Final = {
    getattr(socket, name): value
    for name, value in (
        ("TCP_KEEPIDLE", 5),
        ("TCP_KEEPINTVL", 2),
        ("TCP_KEEPCNT", 3),
        ("TCP_USER_TIMEOUT", 10_000),
    )
    if hasattr(socket, name)
}


def connect(url: str, answer_s: float = SOCKET_TIMEOUT_S) -> RedisClient:
    """A client of the Redis at `url` that waits up to `answer_s` seconds for an answer.

    It never sends a command twice by itself. redis-py retries ten times by default, and would store
    a write twice whose answer was lost. Here the caller, who knows what may be repeated, gets the
    error, as `farm_errors` names it. `BadRedisUrl` for a wrong URL; see `plateau.farm.redis.url`.
    """
    options = {"retry": Retry(NoBackoff(), 0), **link_options(url, answer_s)}
    opened: RedisClient = open_link(url, _Redis, redis.Sentinel, options)
    return opened


def connect_to_renew(url: str, lease_s: float) -> RedisClient:
    """A client to renew leases: it waits for a fifth of the lease, and a second or more.

    So a lost answer leaves time to ask again.
    """
    return connect(url, min(SOCKET_TIMEOUT_S, max(1.0, lease_s / 5)))


def link_options(url: str, answer_s: float = SOCKET_TIMEOUT_S) -> dict[str, Any]:
    """redis-py's options for all connections to the Redis at `url`."""
    options: dict[str, Any] = {
        "decode_responses": True,
        "protocol": 2,
        "socket_timeout": answer_s,
        "socket_connect_timeout": min(_CONNECT_S, answer_s),
        "driver_info": None,  # the connection does not introduce itself: not every user may
    }
    if not url.startswith("unix:"):
        options |= {"socket_keepalive": True, "socket_keepalive_options": _SILENCE}
    return options


def open_link(url: str, client: Any, sentinel: Any, options: dict[str, Any]) -> Any:
    """A client of the URL's Redis, or of the master that its sentinels name.

    `client` and `sentinel` are redis-py's, for threads or asyncio. The URL overrules the options.
    """
    sentinels = redis_url.sentinels_of(url)
    if sentinels is None:
        redis_url.check(url)
        return client.from_url(url, **options)
    hasty = {"socket_timeout": _SENTINEL_S, "socket_connect_timeout": _SENTINEL_S}
    theirs = options | hasty | sentinels.own_options
    manager = sentinel(sentinels.addresses, sentinel_kwargs=theirs)
    return manager.master_for(sentinels.service, client, **(options | sentinels.options))


def now_ms(client: RedisClient) -> int:
    """Redis's clock in milliseconds, which all processes go by."""
    seconds, microseconds = client.time()
    return int(seconds) * 1000 + int(microseconds) // 1000


_AWAY: Final = (
    redis.exceptions.ConnectionError,
    redis.exceptions.TimeoutError,
    redis.exceptions.OutOfMemoryError,
    redis.exceptions.ReadOnlyError,
)
#: Redis's answers while it is full, loading, failing over, or cannot write to its disk. Inside a
#: script they are part of a longer message.
_REFUSES: Final = re.compile(
    r"\b(OOM|MISCONF|LOADING|BUSY|READONLY|MASTERDOWN|NOREPLICAS|TRYAGAIN|CLUSTERDOWN)\b"
)
#: Its answers where the user may not use a key, a channel or a command; the second is Redis 6.2's,
#: from a script.
_FORBIDS: Final = re.compile(r"\bNOPERM\b|The user executing the script can't")


@contextmanager
def farm_errors() -> Iterator[None]:
    """Raise `StoreUnavailable` for redis-py's errors while Redis is away or refuses temporarily.

    And `NotPermitted` where this user lacks the right, or `WrongPassword`.
    """
    try:
        yield
    except redis.exceptions.AuthenticationError as error:
        raise WrongPassword(f"Redis cannot be reached: {error}") from error
    except _AWAY as error:
        raise StoreUnavailable(f"Redis cannot be reached: {error}") from error
    except redis.exceptions.ResponseError as error:
        if isinstance(error, redis.exceptions.NoPermissionError) or _FORBIDS.search(str(error)):
            raise NotPermitted(str(error)) from error
        if _REFUSES.search(str(error)) is None:
            raise
        raise StoreUnavailable(f"Redis refuses: {error}") from error


class _Pipeline(redis.client.Pipeline):  # type: ignore[misc]
    def execute(self, raise_on_error: bool = True) -> list[Any]:
        with farm_errors():
            answers: list[Any] = super().execute(raise_on_error)
        return answers


class _Redis(redis.Redis):  # type: ignore[misc]
    """redis-py's client, with the farm's errors; subscriptions need `farm_errors` themselves."""

    def execute_command(self, *arguments: Any, **options: Any) -> Any:
        with farm_errors():
            return super().execute_command(*arguments, **options)

    def pipeline(self, transaction: bool = True, shard_hint: Any = None) -> _Pipeline:
        return _Pipeline(self.connection_pool, self.response_callbacks, transaction, shard_hint)
