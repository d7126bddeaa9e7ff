"""A network between a farm and its Redis that can fail: cut, silent, slow, or losing answers."""

import socket
import time
from pathlib import Path

from tests.support.faults.relay import Relay


class RedisProxy(Relay):
    """Forwards TCP connections to a Redis on a Unix socket, in one of these moods.

    ``through`` forwards; ``refuse`` closes what there is and what comes; ``silent`` accepts and
    forwards nothing in either direction, as a cut cable; ``deaf`` forwards what is asked and drops
    the answers, so that every write is done and none is confirmed; ``forgetful`` drops one answer,
    after `answers_before` others, with its connection, and forwards again. `delay_s` is added to
    each packet in each direction.
    """

    def __init__(self, redis_socket: Path) -> None:
        self._redis_socket = str(redis_socket)
        self.mood = "through"
        self.delay_s = 0.0
        self.answers_before = 0
        self.refused = 0  #: connections that came while it refuses
        super().__init__()
        self.url = f"redis://{self.address}"

    def fail(self, mood: str) -> None:
        self.mood = mood
        if mood == "refuse":
            self.hang_up()

    def heal(self) -> None:
        """Forward again; connections that lost something are closed, as a network would."""
        lossy = self.mood in {"silent", "deaf"}
        self.mood = "through"
        if lossy:
            self.hang_up()

    def connected(self) -> socket.socket:
        if self.mood == "refuse":
            self.refused += 1
            raise ConnectionRefusedError
        server = socket.socket(socket.AF_UNIX)
        try:
            server.connect(self._redis_socket)
        except OSError:  # Redis itself is gone
            server.close()
            raise
        return server

    def passes(self, piece: bytes, asks: bool, about: object) -> bool:
        if self.delay_s:
            time.sleep(self.delay_s)
        if self.mood == "forgetful" and not asks:
            self.answers_before -= 1
            if self.answers_before < 0:
                self.mood = "through"
                raise ConnectionResetError
        return not (self.mood == "silent" or (self.mood == "deaf" and not asks))
