"""Commands that store API keys and take requests from their buckets."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class PutKey(Command[bool]):
    """Store a key; answers whether the stored one was still `instead_of`."""

    key: str
    instead_of: str  #: JSON; "" for a new key
    known: str  #: JSON


@dataclass(frozen=True, kw_only=True)
class Handful:
    """Requests that were taken out of a bucket."""

    taken: int
    wait_ms: float  #: until the next request, if none was taken


@dataclass(frozen=True, kw_only=True)
class Take(Command[Handful]):
    """Take up to `wanted` requests out of a key's bucket."""

    key: str
    wanted: int
    interval_ms: float  #: in which the bucket gains one
    burst: int  #: most requests in the bucket
