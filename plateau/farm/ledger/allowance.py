"""The rate limit of a key's requests: a bucket in Redis, shared by all API processes.

A bucket holds `burst` requests and fills at the key's rate (the generic cell rate algorithm: one
number for each key, the time at which the bucket will be full). Redis syncs each write to the disk,
which costs milliseconds. So a process takes a handful of requests at a time, at most a tenth of a
burst or of a minute's rate, and grants them from memory for a minute. A key never gets more than
its rate and its burst; requests left of a handful are lost.
"""

import threading
import time
from dataclasses import dataclass
from typing import Final

from plateau.farm.ledger.api_keys import ApiKey
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.commands.api_keys import Take
from plateau.farm.redis.scripts import Scripts

#: A handful expires after this; so a key's last use is known to a minute.
_HANDFUL_S: Final = 60.0


@dataclass
class _Handful:
    requests: int
    until: float  #: of the monotonic clock


class Allowance:
    """Grants the requests of all keys, in one API process; may be used from several threads."""

    def __init__(self, client: RedisClient) -> None:
        self._scripts = Scripts(client)
        self._lock = threading.Lock()
        self._in_hand: dict[str, _Handful] = {}

    def seconds_to_wait(self, key: ApiKey) -> float:
        """Count a request and return 0, or return the wait until the key may make the next.

        Raises `StoreUnavailable` when Redis is away.
        """
        if self._granted_from_memory(key.id):
            return 0.0
        limits = key.limits
        wanted = max(1, int(min(limits.burst, limits.requests_per_minute) // 10))
        interval_ms = 60_000 / limits.requests_per_minute
        got = self._scripts.run(
            Take(key=key.id, wanted=wanted, interval_ms=interval_ms, burst=limits.burst)
        )
        if not got.taken:
            return got.wait_ms / 1000
        with self._lock:
            self._in_hand[key.id] = _Handful(got.taken - 1, time.monotonic() + _HANDFUL_S)
        return 0.0

    def _granted_from_memory(self, key_id: str) -> bool:
        with self._lock:
            handful = self._in_hand.get(key_id)
            if handful is None or not handful.requests or handful.until < time.monotonic():
                return False
            handful.requests -= 1
            return True
