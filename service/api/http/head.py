"""HEAD for every path that has a GET."""

from contextlib import suppress
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: In the request's scope: only the headers of the answer are wanted.
HEADERS_ONLY: Final = "plateau.headers_only"


class _Answered(Exception):
    """The headers are sent: nothing more of the answer is needed."""


class HeadAsGet:
    """Answers HEAD with the headers of the GET, and ends it before its body, however long."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on; a HEAD as a GET."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self._app(scope, receive, send)
            return

        async def headers_alone(message: Message) -> None:
            if message["type"] == "http.response.body":
                await send({"type": "http.response.body", "body": b""})
                raise _Answered
            await send(message)

        # The server goes by its own scope's method, which has to stay.
        asked = {**scope, "method": "GET", HEADERS_ONLY: True}
        with suppress(_Answered):
            await self._app(asked, receive, headers_alone)
        scope["route"] = asked.get("route")
