"""A network between a farm and its Redis that can fail: cut, silent, slow, or losing answers."""

import contextlib
import socket
import threading
import time
from pathlib import Path
from types import TracebackType


class RedisProxy:
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
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.url = f"redis://127.0.0.1:{self._listener.getsockname()[1]}"
        self._open: set[socket.socket] = set()
        self._acceptor = threading.Thread(target=self._accept, daemon=True)
        self._acceptor.start()

    def __enter__(self) -> "RedisProxy":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._acceptor.join()
        self._listener.close()
        self.hang_up()

    def hang_up(self) -> None:
        """Close every connection; what was under way in them is lost."""
        for one in tuple(self._open):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

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

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, socket.socket(socket.AF_UNIX) as server:
            if self.mood == "refuse":
                self.refused += 1
                return
            try:
                server.connect(self._redis_socket)
            except OSError:  # Redis itself is gone
                return
            self._open |= {client, server}
            answers = threading.Thread(target=self._pump, args=(server, client, False))
            answers.start()
            self._pump(client, server, True)
            answers.join()
            self._open -= {client, server}

    def _pump(self, source: socket.socket, sink: socket.socket, asks: bool) -> None:
        with contextlib.suppress(OSError):
            while chunk := source.recv(65536):
                if self.delay_s:
                    time.sleep(self.delay_s)
                if self.mood == "silent" or (self.mood == "deaf" and not asks):
                    continue
                if self.mood == "forgetful" and not asks:
                    self.answers_before -= 1
                    if self.answers_before < 0:
                        self.mood = "through"
                        break
                sink.sendall(chunk)
        for one in (source, sink):
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
