"""The HTTP server below the app: connections, and the server's own answers.

uvicorn closes a connection that is silent after an answer, but waits for ever for a first request
and for the rest of a slow one. And asyncio, which cannot accept connections while the process has
no descriptor left, logs that thousands of times (python/cpython#151615). So here a request's head
has ten seconds, each piece of its body a minute, and the number of connections is limited below
that of descriptors. A stream of events may take any time; the kernel ends one that nobody reads
(`listen` in `plateau.service.api.process`).
"""

import asyncio
import resource
from http import HTTPStatus
from typing import Any, Final

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem, ProblemType

#: Headers of every answer. A browser believes the media type, and no page of another site can load
#: the answer as an image or a script. The server adds them because not every answer passes the
#: app's layers: it refuses some requests itself, and the framework answers unexpected errors.
ON_EVERY_ANSWER: Final = [
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
]

#: The longest time of a request's head, in seconds.
HEAD_S: Final = 10.0
#: The longest silence within a request's body, in seconds.
BODY_S: Final = 60.0
#: The most connections that one process can serve well.
_MOST_CONNECTIONS: Final = 10_000
#: Descriptors for other uses: Redis, the blob store, logs, connections about to be refused.
_OTHERS: Final = 256
#: A connection may need a second descriptor, for an uploaded file or for events from Redis.
_DESCRIPTORS_EACH: Final = 2
#: The most connections that wait to be accepted; asyncio accepts this many at once.
_LONGEST_BACKLOG: Final = 2048


def raise_descriptor_limit() -> int:
    """Raise this process's limit of descriptors as far as it may; returns the new limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        except (OSError, ValueError):
            return soft  # macOS reports no limit and has one
    return _MOST_CONNECTIONS * _DESCRIPTORS_EACH if hard == resource.RLIM_INFINITY else hard


def most_connections(descriptors: int) -> int:
    """The most connections of a process with this many descriptors."""
    spare = max(descriptors - _OTHERS, descriptors // 2)
    return max(1, min(_MOST_CONNECTIONS, spare // _DESCRIPTORS_EACH))


def backlog(descriptors: int) -> int:
    """The most connections that may wait to be accepted, besides the open ones."""
    return max(1, min(_LONGEST_BACKLOG, most_connections(descriptors) // 2))


class Connection(H11Protocol):
    """A connection with a deadline for the heads and the bodies of its requests.

    It always uses h11, because HTTP parsers differ in what they accept. A connection beyond
    uvicorn's `limit_concurrency` is answered 503 before it sends a request.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._awaited: object = None  #: the client's state in h11: what it has to send
        self._deadline = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept the connection, or refuse it above the limit."""
        super().connection_made(transport)
        if self.limit_concurrency is not None and len(self.connections) >= self.limit_concurrency:
            self.refuse(problems.TOO_MANY_CONNECTIONS)
        else:
            self._watch()

    def data_received(self, data: bytes) -> None:
        """Parse the data, then set, move or clear the deadline."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Set the deadline for the next request."""
        super().on_response_complete()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Clear the deadline."""
        self._stop_timer()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  (the problem says more)
        """Refuse an unreadable request with a problem."""
        if self.cycle is not None:  # the app may still be answering a request with a broken body
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.refuse(problems.NOT_HTTP)

    def refuse(self, kind: ProblemType) -> None:
        """Answer with a problem, unless an answer has begun, and close the connection."""
        if self.conn.our_state in {h11.IDLE, h11.SEND_RESPONSE}:
            answer = Problem(kind).response("")
            headers = [*self.server_state.default_headers, *answer.raw_headers]
            reason = HTTPStatus(answer.status_code).phrase.encode()
            for event in (
                h11.Response(status_code=answer.status_code, headers=headers, reason=reason),
                h11.Data(data=bytes(answer.body)),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(event) or b"")
        self.transport.close()

    def _watch(self) -> None:
        """Set the deadline of a head or a body; move that of a body, of which more has come."""
        now, awaited = self.loop.time(), self.conn.their_state
        if awaited is self._awaited and awaited is h11.SEND_BODY:
            self._deadline = now + BODY_S
        elif awaited is not self._awaited:
            self._awaited = awaited
            self._stop_timer()
            if awaited in {h11.IDLE, h11.SEND_BODY} and not self.transport.is_closing():
                self._deadline = now + (HEAD_S if awaited is h11.IDLE else BODY_S)
                self._timer = self.loop.call_at(self._deadline, self._look_at_clock)

    def _look_at_clock(self) -> None:
        """Close the connection if the deadline has passed."""
        if self.flow.read_paused:  # the app is slow, and not the client
            self._deadline = self.loop.time() + BODY_S
        if self._deadline > self.loop.time():
            self._timer = self.loop.call_at(self._deadline, self._look_at_clock)
        else:
            self.transport.close()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def server_config(app: ASGIApp, *, grace_s: int, **options: Any) -> uvicorn.Config:
    """The server's configuration; `options` are uvicorn's own.

    A request may take `grace_s` more seconds once the server stops.
    """
    return uvicorn.Config(
        app,
        http=Connection,
        loop="asyncio",
        ws="none",  # the API has no WebSockets, and their parsers answer requests by themselves
        headers=ON_EVERY_ANSWER,
        log_config=None,  # the process configures the log
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=grace_s,
        **options,
    )
