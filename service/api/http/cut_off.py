"""Requests that a stopping API ends before their time: answered, so that clients repeat them."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.service.api.problems.problem import unavailable


class AnswerWhenCutOff:
    """Answers 503 to a request whose task is cancelled before there is an answer.

    The server does that to what it still has a while after it was told to stop, and would answer
    500, which tells a client to give up; but every call to Plateau may be repeated.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and see whether it is answered."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        has_begun = False

        async def seen(message: Message) -> None:
            nonlocal has_begun
            has_begun = True
            await send(message)

        try:
            await self._app(scope, receive, seen)
        except asyncio.CancelledError:
            if has_begun:
                raise
            cut_off = unavailable(scope["method"], scope["path"], Exception("the API stops"))
            await cut_off.response(scope["path"])(scope, receive, send)
