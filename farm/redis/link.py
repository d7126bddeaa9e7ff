"""The connection to Redis: no silent retries, and one error when it is away."""

import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from plateau.farm.model.errors import NotPermitted, StoreUnavailable
from plateau.farm.redis import url as redis_url
from plateau.farm.redis.client import RedisClient

#: Longer than any blocking read, so that none is taken for a dead connection.
SOCKET_TIMEOUT_S = 10.0
_CONNECT_S: Final = 5.0
#: A sentinel answers at once, or another one is asked.
_SENTINEL_S: Final = 2.0

#: A connection on which nothing comes is probed, and given up when nothing was heard for 10 s: a
#: network may fail without a word. So long, too, the kernel tries to bring over what was sent
#: before, of a connection that we have closed as well: a command that was given up can still be
#: carried out so much later. Platforms have not all of these.
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
    """A client of the Redis at `url` that never sends a command twice by itself.

    redis-py retries ten times by default; a write whose answer was lost would then be stored
    twice. Here an error reaches the caller, who knows what may be repeated.

    `answer_s` is how long an answer is waited for, in seconds.

    Raises
    ------
    BadRedisUrl
        It is no such URL; see `plateau.farm.redis.url`.
    """
    options = {"retry": Retry(NoBackoff(), 0), **link_options(url, answer_s)}
    opened: RedisClient = open_link(url, redis.Redis, redis.Sentinel, options)
    return opened


def connect_to_renew(url: str, lease_s: float) -> RedisClient:
    """A client for who renews leases: where an answer is lost, there is time to ask again.

    It waits for a fifth of the lease at most, but never for less than a second.
    """
    return connect(url, min(SOCKET_TIMEOUT_S, max(1.0, lease_s / 5)))


def link_options(url: str, answer_s: float = SOCKET_TIMEOUT_S) -> dict[str, Any]:
    """What all connections to the Redis at `url` have in common, as redis-py's options."""
    options: dict[str, Any] = {
        "decode_responses": True,
        "protocol": 2,
        "socket_timeout": answer_s,
        "socket_connect_timeout": min(_CONNECT_S, answer_s),
        "driver_info": None,  # it does not introduce itself: not every user may
    }
    if not url.startswith("unix:"):
        options |= {"socket_keepalive": True, "socket_keepalive_options": _SILENCE}
    return options


def open_link(url: str, client: Any, sentinel: Any, options: dict[str, Any]) -> Any:
    """A client of one of redis-py's kinds; where sentinels are named, of whom they call master.

    `client` and `sentinel` are its classes, for threads or for asyncio; of the URL's parameters
    and the options the former count for more.
    """
    sentinels = redis_url.sentinels_of(url)
    if sentinels is None:
        redis_url.check(url)
        return client.from_url(url, **options)
    hasty = {"socket_timeout": _SENTINEL_S, "socket_connect_timeout": _SENTINEL_S}
    theirs = options | hasty | sentinels.own_options
    manager = sentinel(sentinels.addresses, sentinel_kwargs=theirs)
    return manager.master_for(sentinels.service, **(options | sentinels.options))


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


#: And where an ACL keeps the user from a key, a channel or a command; of a script Redis 6.2 says so
#: in its own words.
_FORBIDS: Final = re.compile(r"\bNOPERM\b|The user executing the script can't")


@contextmanager
def unavailable_as_farm_error() -> Iterator[None]:
    """Raise `StoreUnavailable` where redis-py raises because Redis is away or refuses for now.

    And `NotPermitted` where Redis never lets this user do this.
    """
    try:
        yield
    except _AWAY as error:
        raise StoreUnavailable(f"Redis cannot be reached: {error}") from error
    except redis.exceptions.ResponseError as error:
        if isinstance(error, redis.exceptions.NoPermissionError) or _FORBIDS.search(str(error)):
            raise NotPermitted(str(error)) from error
        if _REFUSES.search(str(error)) is None:
            raise
        raise StoreUnavailable(f"Redis refuses: {error}") from error
