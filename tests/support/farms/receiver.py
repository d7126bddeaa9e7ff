"""A real receiver of notices, by http or https, that answers what a test tells it to."""

import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from standardwebhooks import Webhook

from tests.support.threads import working

#: A secret of Standard Webhooks.
SECRET = "whsec_" + "c2VjcmV0IG9mIGEgdGVzdCwgMzIgYnl0ZXMgbG9uZyE="


@dataclass(frozen=True)
class Received:
    """A request as it came in."""

    path: str
    headers: dict[str, str]
    body: bytes

    @property
    def id(self) -> str:
        return self.headers["webhook-id"]

    def verified(self, secret: str = SECRET) -> dict[str, Any]:
        """The message, its signature verified by the library of Standard Webhooks."""
        return Webhook(secret).verify(self.body, self.headers)


#: What to answer: a status, and headers.
Answer = tuple[int, dict[str, str]]
OK: Answer = (200, {})


class Receiver:
    """The requests that came, and the answers that are to be given.

    `answers` is asked with the request's number, from 1, and the request; it may take its time.
    """

    def __init__(self, answers: Callable[[int, Received], Answer] = lambda *_: OK) -> None:
        self.answers = answers
        self.received: list[Received] = []
        self.url = ""
        self._more = threading.Condition()

    def wait_for(self, count: int, seconds: float = 30) -> list[Received]:
        """The requests, once there are so many."""
        with self._more:
            came = self._more.wait_for(lambda: len(self.received) >= count, seconds)
            assert came, f"{len(self.received)} of {count} requests came"
            return list(self.received)

    def take(self, received: Received) -> Answer:
        with self._more:
            self.received.append(received)
            number = len(self.received)
            self._more.notify_all()
        return self.answers(number, received)


@contextmanager
def receiving(
    answers: Callable[[int, Received], Answer] = lambda *_: OK, tls: ssl.SSLContext | None = None
) -> Iterator[Receiver]:
    """A receiver on a port of its own; by https where it has a certificate."""
    receiver = Receiver(answers)

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            headers = {name.lower(): value for name, value in self.headers.items()}
            body = self.rfile.read(int(headers.get("content-length", 0)))
            status, more = receiver.take(Received(self.path, headers, body))
            self.send_response(status)
            for name, value in more.items():
                self.send_header(name, value)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None:
            """Leave it at that: who asked has gone away."""

    server = Server(("127.0.0.1", 0), Handler)
    if tls is not None:
        server.socket = tls.wrap_socket(server.socket, server_side=True)
    scheme = "http" if tls is None else "https"
    receiver.url = f"{scheme}://127.0.0.1:{server.server_port}/hook?from=plateau"
    with server, working(lambda: server.serve_forever(0.05), server.shutdown):
        yield receiver
