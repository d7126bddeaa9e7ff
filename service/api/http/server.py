"""The HTTP server below the app: what it adds to every answer, and what it answers by itself."""

from typing import Any, Final

import uvicorn
from starlette.types import ASGIApp

from plateau.service.api.http.connections import Connection, Loop
from plateau.service.api.problems.problem import MALFORMED_REQUEST, Problem

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


class Protocol(Connection):
    """HTTP/1.1 by h11, whichever parsers are installed: they differ in what they let through."""

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  (the problem says more)
        """Answer what cannot be read with a problem, where no answer has begun; hang up."""
        if self.cycle is not None:  # the app may still answer a request whose body is broken
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.refuse(_UNREADABLE)


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
        http=Protocol,
        loop=f"{Loop.__module__}:{Loop.__name__}",
        ws="none",  # nothing here speaks WebSocket, and its parsers answer requests on their own
        headers=ON_EVERY_ANSWER,
        log_config=None,  # its lines go the way of ours
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=grace_s,
        **options,
    )
