"""Waking each other up: hints over pub/sub, so that nobody polls quickly and nobody waits long."""

import threading
import time
from typing import Final

import redis

from farm.redis_link import unavailable_as_farm_error

#: Between two looks whether a wait is to end; Redis is not asked for it.
_STOP_LOOK_S: Final = 0.1


class Wake:
    """Messages on one channel. A lost one costs nothing but the wait for the next look."""

    def __init__(self, client: redis.Redis, channel: str) -> None:
        self._pubsub = client.pubsub(ignore_subscribe_messages=True)
        self._channel = channel
        self._subscribed = False

    def wait(self, timeout_s: float, stop: threading.Event) -> set[str]:
        """The messages that arrived, after waiting up to `timeout_s` for the first.

        The wait ends soon after `stop` is set.
        """
        with unavailable_as_farm_error():
            if not self._subscribed:
                self._pubsub.subscribe(self._channel)
                self._subscribed = True
            heard: set[str] = set()
            deadline = time.monotonic() + timeout_s
            while True:
                over = heard or stop.is_set()
                left = 0.0 if over else max(0.0, deadline - time.monotonic())
                message = self._pubsub.get_message(timeout=min(left, _STOP_LOOK_S))
                if message is not None:
                    heard.add(message["data"])
                elif left == 0.0:
                    return heard

    def close(self) -> None:
        """Unsubscribe and give the connection back."""
        self._pubsub.close()
