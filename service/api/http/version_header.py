"""Answers under ``/v1`` say which Plateau gives them: a client may be of another age."""

from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.farm.model import versions

HEADER: Final = "Plateau-Version"


class SayVersion:
    """Adds the header to what is answered to those who are let in."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._header = (HEADER.lower().encode(), versions.plateau().encode())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and add to its answer."""
        if scope["type"] != "http" or not scope["path"].startswith("/v1/"):
            await self._app(scope, receive, send)
            return

        async def signed(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], self._header]
            await send(message)

        await self._app(scope, receive, signed)
