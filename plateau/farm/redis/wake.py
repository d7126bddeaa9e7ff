"""Hints over pub/sub, so that no process polls often and none waits long."""

import time
from typing import Any, Final

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.process.waits import Stop, await_any
from plateau.farm.redis.client import RedisClient
from plateau.farm.redis.link import farm_errors

#: After this silence the listener pings Redis, and waits this long for the answer: otherwise it
#: would never notice a connection that is dead but not closed.
_QUIET_S: Final = 10.0
_ANSWER_S: Final = 5.0


class Wake:
    """Messages on one channel. A lost one costs only the wait for the next look."""

    def __init__(
        self,
        client: RedisClient,
        channel: str,
        *,
        quiet_s: float = _QUIET_S,
        answer_s: float = _ANSWER_S,
    ) -> None:
        self._pubsub = client.pubsub()
        self._channel = channel
        self._quiet_s = quiet_s
        self._answer_s = answer_s
        self._subscribed = False
        self._heard_at = 0.0  # time of the last message of any kind
        self._asked_at: float | None = None  # time of a ping that is not answered yet

    def wait(self, timeout_s: float, stop: Stop) -> set[str]:
        """The messages that arrived, after a wait of up to `timeout_s`, or until `stop`, for one.

        Raises
        ------
        StoreUnavailable
            Redis is away, or has not answered for long: the next call subscribes anew.
        """
        try:
            with farm_errors():
                return self._wait(timeout_s, stop)
        except StoreUnavailable:
            self._pubsub.reset()
            self._subscribed = False
            raise

    def _wait(self, timeout_s: float, stop: Stop) -> set[str]:
        if not self._subscribed:
            self._pubsub.subscribe(self._channel)
            self._subscribed, self._heard_at, self._asked_at = True, time.monotonic(), None
        heard: set[str] = set()
        deadline = time.monotonic() + timeout_s
        while True:
            message = self._next()
            if message is None:
                left_s = deadline - time.monotonic()
                if heard or stop.is_set() or left_s <= 0:
                    return heard
                # redis-py waits only for its socket; this wait also ends at a stop.
                socket = self._pubsub.connection._sock
                await_any(socket, stop, timeout_s=min(left_s, self._check_s()))
            elif message["type"] == "message":
                heard.add(message["data"])

    def _next(self) -> dict[str, Any] | None:
        """The next message that has arrived, if any; pings Redis after a silence."""
        message: dict[str, Any] | None = self._pubsub.get_message(timeout=0.0)
        if message is not None:
            self._heard_at, self._asked_at = time.monotonic(), None
        elif self._check_s() <= 0:
            if self._asked_at is not None:
                raise StoreUnavailable("Redis cannot be reached: it says nothing any more")
            self._pubsub.ping()
            self._asked_at = time.monotonic()
        return message

    def _check_s(self) -> float:
        """Seconds until a ping, or the answer to it, is due."""
        if self._asked_at is None:
            return self._heard_at + self._quiet_s - time.monotonic()
        return self._asked_at + self._answer_s - time.monotonic()

    def close(self) -> None:
        """Unsubscribe and give the connection back."""
        self._pubsub.close()
