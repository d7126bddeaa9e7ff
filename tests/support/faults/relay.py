"""Forwards TCP connections to a server, but for what it is told to lose."""

import contextlib
import socket
import threading
from abc import ABC, abstractmethod
from typing import Any


class Relay(ABC):
    """Listens on a port of its own until the context ends; a subclass says what passes."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._open: set[socket.socket] = set()
        self._acceptor = threading.Thread(target=self._accept, daemon=True)
        self._acceptor.start()

    @abstractmethod
    def connected(self) -> socket.socket:
        """A connection to the server; raises `OSError` where the client is to have none."""

    @abstractmethod
    def passes(self, piece: bytes, asks: bool, about: dict[str, Any]) -> bool:
        """Whether a piece is forwarded; raises `ConnectionError` to close the connection.

        `asks` says whether the client sends it. `about` is the connection's, for notes.
        """

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._acceptor.join()
        self._listener.close()
        self.hang_up()

    def hang_up(self) -> None:
        """Close every connection; what was under way in them is lost."""
        for one in tuple(self._open):
            _shut(one)

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError), self.connected() as server:
            self._open |= {client, server}
            about: dict[str, Any] = {}
            answers = threading.Thread(target=self._pump, args=(server, client, False, about))
            answers.start()
            self._pump(client, server, True, about)
            answers.join()
            self._open -= {client, server}

    def _pump(
        self, source: socket.socket, sink: socket.socket, asks: bool, about: dict[str, Any]
    ) -> None:
        with contextlib.suppress(OSError):
            while piece := source.recv(1 << 16):
                if self.passes(piece, asks, about):
                    sink.sendall(piece)
        _shut(source)
        _shut(sink)


def _shut(one: socket.socket) -> None:
    with contextlib.suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
