"""Layers of the app around its routes: each sees every HTTP request and its answer."""

import asyncio
import re
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Final
from urllib.parse import unquote

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.farm.model import versions
from plateau.farm.process.log import concern
from plateau.service.api.problems.catalogue import API_STOPS, unavailable

_VERSION: Final = b"plateau-version"
_JOB: Final = re.compile(r"/v1/jobs/([0-9a-f]{12})(?:/slices/(\d{1,9})\b)?")
_BATCHES: Final = "/v1/batches/"


class Layer(ABC):
    """A layer of the app; it sees requests only, not the app's start and end."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request; pass anything else on."""
        await (self.serve if scope["type"] == "http" else self.app)(scope, receive, send)

    @abstractmethod
    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer the request, or hand it to the next layer, which is `app`."""


class AnswerWhenCutOff(Layer):
    """Answers 503 to a request whose task is cancelled before it was answered.

    A stopping server cancels slow requests and would answer 500, which tells a client to give up;
    but every call to Plateau may be repeated.
    """

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and note whether it is answered."""
        has_begun = False

        async def seen(message: Message) -> None:
            nonlocal has_begun
            has_begun = True
            await send(message)

        try:
            await self.app(scope, receive, seen)
        except asyncio.CancelledError:
            if has_begun:
                raise
            cut_off = unavailable(scope["method"], scope["path"], API_STOPS)
            await cut_off.response(scope["path"])(scope, receive, send)


class LogFields(Layer):
    """Adds the job and the slice of a request's path to the log lines of the request."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve the request; it is a task of its own, so no other request's lines change."""
        found = _JOB.match(scope["path"])
        if found is not None:
            concern(found[1], None if found[2] is None else int(found[2]))
        await self.app(scope, receive, send)


class SayVersion(Layer):
    """Adds Plateau's version to answers under ``/v1``: a client may have another one."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, and add the header to its answer."""

        async def signed(message: Message) -> None:
            if message["type"] == "http.response.start":
                header = (_VERSION, versions.plateau().encode())
                message["headers"] = [*message["headers"], header]
            await send(message)

        await self.app(scope, receive, signed if scope["path"].startswith("/v1/") else send)


class _Answered(Exception):
    """The headers are sent, so the rest of the answer is not needed."""


class HeadAsGet(Layer):
    """Answers HEAD with the headers of the GET, which is ended before its body."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, a HEAD as a GET."""
        if scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def headers_alone(message: Message) -> None:
            if message["type"] == "http.response.body":
                await send({"type": "http.response.body", "body": b""})
                raise _Answered
            await send(message)

        # A copy: the server reads the method from its own scope.
        asked = {**scope, "method": "GET"}
        with suppress(_Answered):
            await self.app(asked, receive, headers_alone)
        scope["route"] = asked.get("route")


class KeepSlashes(Layer):
    """Keeps ``/`` and ``%`` encoded in the segments of a batch's path.

    So a batch's name is one segment of the path, whatever its characters. ASGI decodes paths, after
    which a slash in a name looks like one between segments.
    """

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, with a batch's path made from the raw one."""
        if scope["path"].startswith(_BATCHES) and "raw_path" in scope:
            raw = scope["raw_path"].partition(b"?")[0].decode("ascii", "replace")
            segments = (unquote(segment) for segment in raw.split("/"))
            kept = (one.replace("%", "%25").replace("/", "%2F") for one in segments)
            asked = {**scope, "path": "/".join(kept)}
            try:
                await self.app(asked, receive, send)
            finally:
                scope["route"] = asked.get("route")
        else:
            await self.app(scope, receive, send)
