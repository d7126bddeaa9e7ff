"""Waking each other up: hints over pub/sub, so that nobody polls quickly and nobody waits long."""

import threading
import time
from typing import Any, Final

import redis

from farm.errors import StoreUnavailable
from farm.redis_link import unavailable_as_farm_error

#: Between two looks whether a wait is to end; Redis is not asked for it.
_STOP_LOOK_S: Final = 0.1
#: So long nothing is heard before Redis is asked whether it is still there, and so long its answer
#: may take: else a listener whose connection is dead, but not closed, would be deaf for good.
_QUIET_S: Final = 10.0
_ANSWER_S: Final = 5.0


class Wake:
    """Messages on one channel. A lost one costs nothing but the wait for the next look."""

    def __init__(
        self,
        client: redis.Redis,
        channel: str,
        *,
        quiet_s: float = _QUIET_S,
        answer_s: float = _ANSWER_S,
    ) -> None:
        self._pubsub = client.pubsub(ignore_subscribe_messages=True)
        self._channel = channel
        self._quiet_s = quiet_s
        self._answer_s = answer_s
        self._subscribed = False
        self._heard_at = 0.0  # when anything came
        self._asked_at: float | None = None  # since when an answer is due

    def wait(self, timeout_s: float, stop: threading.Event) -> set[str]:
        """The messages that arrived, after waiting up to `timeout_s` for the first.

        The wait ends soon after `stop` is set.

        Raises
        ------
        StoreUnavailable
            Redis is away, or has not answered for long: the next call subscribes anew.
        """
        try:
            with unavailable_as_farm_error():
                return self._wait(timeout_s, stop)
        except StoreUnavailable:
            self._pubsub.reset()
            self._subscribed = False
            raise

    def _wait(self, timeout_s: float, stop: threading.Event) -> set[str]:
        if not self._subscribed:
            self._pubsub.subscribe(self._channel)
            self._subscribed, self._heard_at, self._asked_at = True, time.monotonic(), None
        heard: set[str] = set()
        deadline = time.monotonic() + timeout_s
        while True:
            over = heard or stop.is_set()
            left = 0.0 if over else max(0.0, deadline - time.monotonic())
            message = self._next(min(left, _STOP_LOOK_S))
            if message is not None:
                heard.add(message["data"])
            elif left == 0.0:
                return heard

    def _next(self, timeout_s: float) -> dict[str, Any] | None:
        """The next message, if one comes in this time; sees to it that one still could."""
        message: dict[str, Any] | None = self._pubsub.get_message(timeout=timeout_s)
        now = time.monotonic()
        if message is not None:
            self._heard_at, self._asked_at = now, None
            return message if message["type"] == "message" else None
        if self._asked_at is not None and now > self._asked_at + self._answer_s:
            raise StoreUnavailable("Redis cannot be reached: it says nothing any more")
        if self._asked_at is None and now > self._heard_at + self._quiet_s:
            self._pubsub.ping()
            self._asked_at = now
        return None

    def close(self) -> None:
        """Unsubscribe and give the connection back."""
        self._pubsub.close()
