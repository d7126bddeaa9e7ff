"""The HTTP server below the app: connections, and what the server answers by itself.

uvicorn closes a connection that is silent after an answer, but waits for ever for a first request,
and for the rest of one that comes a byte at a time. And asyncio, which can accept nothing while the
process has no descriptor left, says so thousands of times (python/cpython#151615). So here a
request's head has ten seconds, and connections end below the limit of descriptors. What follows a
head, an upload or a stream of events, takes as long as it takes.
"""

import asyncio
import resource
from http import HTTPStatus
from typing import Any, Final

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from plateau.service.api.problems.problem import BUSY, MALFORMED_REQUEST, Problem

#: On every answer, whoever makes it. A browser takes the body for what its type says and nothing
#: else, and no page of another site can have it as a picture or as a script. The app could not say
#: so everywhere: the server refuses some requests itself, and the framework answers an unexpected
#: error outside all of the app's layers.
ON_EVERY_ANSWER: Final = [
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
]

_UNREADABLE: Final = Problem(
    MALFORMED_REQUEST,
    "the request is not HTTP/1.1 as RFC 9112 has it, or its head has more than 64 KiB; check the "
    "address (http:// or https://), and send fewer or shorter headers",
    headers={"Connection": "close"},
)

#: For so long a request's head, or a TLS handshake, may take to come, in seconds.
HEAD_S: Final = 10.0
#: More are not served by one process anyway.
_MOST_CONNECTIONS: Final = 10_000
#: Descriptors for all else: Redis, the blob store, logs, what is accepted and not yet refused.
_OTHERS: Final = 256
#: A connection may need a second one: a file that is uploaded, a stream of events from Redis.
_DESCRIPTORS_EACH: Final = 2
#: Connections that wait to be accepted; so many are accepted at once.
_LONGEST_BACKLOG: Final = 2048
_TOO_MANY: Final = Problem(
    BUSY,
    "this API has as many connections as it may have; try again in 2 s",
    headers={"Retry-After": "2", "Connection": "close"},
)


def raise_descriptor_limit() -> int:
    """How many descriptors this process may have from now on: as many as it may give itself."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        try:
            resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        except (OSError, ValueError):
            return soft  # macOS shows no bound and has one
    return _MOST_CONNECTIONS * _DESCRIPTORS_EACH if hard == resource.RLIM_INFINITY else hard


def most_connections(descriptors: int) -> int:
    """How many connections a process with so many descriptors may have."""
    spare = max(descriptors - _OTHERS, descriptors // 2)
    return max(1, min(_MOST_CONNECTIONS, spare // _DESCRIPTORS_EACH))


def backlog(descriptors: int) -> int:
    """How many connections may wait to be accepted: they have to fit in beside those there are."""
    return max(1, min(_LONGEST_BACKLOG, most_connections(descriptors) // 2))


class Connection(H11Protocol):
    """One connection, whose requests' heads have a deadline.

    HTTP/1.1 by h11, whichever parsers are installed: they differ in what they let through.

    A connection that makes them as many as uvicorn's `limit_concurrency` is answered 503 before it
    asks for anything.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take the connection, unless there are too many."""
        super().connection_made(transport)
        if self.limit_concurrency is not None and len(self.connections) >= self.limit_concurrency:
            self.refuse(_TOO_MANY)
        else:
            self._watch()

    def data_received(self, data: bytes) -> None:
        """Take in what came."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """Go on to the next request."""
        super().on_response_complete()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Let the connection go."""
        self._forget_deadline()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  (the problem says more)
        """Answer what cannot be read with a problem, where no answer has begun; hang up."""
        if self.cycle is not None:  # the app may still answer a request whose body is broken
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.refuse(_UNREADABLE)

    def refuse(self, problem: Problem) -> None:
        """Answer with a problem, where no answer has begun; hang up."""
        if self.conn.our_state in {h11.IDLE, h11.SEND_RESPONSE}:
            answer = problem.response("")
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
        """Give a head its time from when it may begin, and what follows it all the time."""
        if self.conn.their_state is not h11.IDLE:
            self._forget_deadline()
        elif self._deadline is None and not self.transport.is_closing():
            self._deadline = self.loop.call_later(HEAD_S, self.timeout_keep_alive_handler)

    def _forget_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class Loop(asyncio.SelectorEventLoop):
    """The event loop of the API, whose TLS handshakes have a deadline, too."""

    async def create_server(self, *arguments: Any, **options: Any) -> Any:
        """As asyncio's; a handshake may take a minute there."""
        if options.get("ssl") is not None:
            options.setdefault("ssl_handshake_timeout", HEAD_S)
        return await super().create_server(*arguments, **options)


def server_config(app: ASGIApp, *, grace_s: int, **options: Any) -> uvicorn.Config:
    """How the app is served.

    Parameters
    ----------
    app
        What answers.
    grace_s
        For how many seconds a request may go on when the server stops.
    options
        More of uvicorn's.
    """
    return uvicorn.Config(
        app,
        http=Connection,
        loop=f"{Loop.__module__}:{Loop.__name__}",
        ws="none",  # nothing here speaks WebSocket, and its parsers answer requests on their own
        headers=ON_EVERY_ANSWER,
        log_config=None,  # its lines go the way of ours
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=grace_s,
        **options,
    )
