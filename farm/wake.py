"""Waking each other up: hints over pub/sub, so that nobody polls quickly and nobody waits long."""

import time

import redis

from farm.redis_link import unavailable_as_farm_error


class Wake:
    """Messages on one channel. A lost one costs nothing but the wait for the next look."""

    def __init__(self, client: redis.Redis, channel: str) -> None:
        self._pubsub = client.pubsub(ignore_subscribe_messages=True)
        self._channel = channel
        self._subscribed = False

    def wait(self, timeout_s: float) -> set[str]:
        """The messages that arrived, after waiting up to `timeout_s` for the first."""
        with unavailable_as_farm_error():
            if not self._subscribed:
                self._pubsub.subscribe(self._channel)
                self._subscribed = True
            heard: set[str] = set()
            deadline = time.monotonic() + timeout_s
            while True:
                left = 0.0 if heard else max(0.0, deadline - time.monotonic())
                message = self._pubsub.get_message(timeout=left)
                if message is not None:
                    heard.add(message["data"])
                elif left == 0.0:
                    return heard

    def close(self) -> None:
        """Unsubscribe and give the connection back."""
        self._pubsub.close()
