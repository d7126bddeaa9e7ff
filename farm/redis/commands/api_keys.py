"""API keys are put, and requests taken from their buckets."""

from dataclasses import dataclass

from plateau.farm.redis.commands.command import Command


@dataclass(frozen=True, kw_only=True)
class PutKey(Command[bool]):
    """Put what is known of a key; whether it was still what it was before is answered."""

    key: str
    instead_of: str  #: JSON; "" for a new key
    known: str  #: JSON


@dataclass(frozen=True, kw_only=True)
class Handful:
    """Requests that were taken out of a bucket."""

    taken: int
    wait_ms: float  #: until there is one, where none was taken


@dataclass(frozen=True, kw_only=True)
class Take(Command[Handful]):
    """Take up to so many requests out of a key's bucket."""

    key: str
    wanted: int
    interval_ms: float  #: in which the bucket gains one
    burst: int  #: requests that it holds
