"""Checks of a request before any route sees it: its origin, and the size of its body."""

import asyncio
import contextlib
import re
import shutil
import tempfile
import time
from collections.abc import Iterable
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from plateau.farm.redis.url import is_loopback
from plateau.service.api.access.callers import ANYBODY, Caller
from plateau.service.api.http.layers import Layer
from plateau.service.api.problems import catalogue as problems
from plateau.service.api.problems.problem import Problem, ProblemType

#: ``Host`` by RFC 9110: a name or an address, and an optional port.
_HOST: Final = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[0-9A-Za-z.-]+)(?::[0-9]{1,5})?")
#: ``Sec-Fetch-Site`` of a typed address or bookmark, and of a page of this service. A page served
#: from another port of this machine is "same-site".
_OWN: Final = frozenset({"none", "same-origin"})
#: Headers that a proxy adds to name its client.
_FROM_A_PROXY: Final = frozenset(
    {b"forwarded", b"x-forwarded-for", b"x-forwarded-host", b"x-real-ip"}
)


def refuse_foreign(scope: Scope) -> None:
    """Raise the problem unless a request names this machine and comes from no other web site.

    An open API listens on loopback only. A web page elsewhere can still make a browser on this
    machine call it: under a name that it points at 127.0.0.1 (DNS rebinding; ``Host`` shows it), by
    a form that posts across sites (``Origin`` shows it), or by an image, a frame or a link (only
    ``Sec-Fetch-Site`` shows it). A proxy on this machine can let others in unawares. An API with
    keys needs none of this: a browser adds no key to another page's requests.
    """
    host = header(scope["headers"], b"host") or ""
    named = _HOST.fullmatch(host)
    if named is None or not is_loopback(named[1]):
        raise Problem(problems.FOREIGN_HOST, host=host)
    if any(name in _FROM_A_PROXY for name, _ in scope["headers"]):
        raise Problem(problems.THROUGH_A_PROXY)
    origin = header(scope["headers"], b"origin")
    if origin is not None and origin.lower() != f"{scope['scheme']}://{host}".lower():
        raise Problem(problems.FOREIGN_ORIGIN, origin=origin)
    site = header(scope["headers"], b"sec-fetch-site")
    if site is not None and site.lower() not in _OWN:
        raise Problem(problems.FOREIGN_SITE, site=site)


def header(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> str | None:
    """The first header of this name, given in lower case."""
    return next((value.decode("latin-1") for key, value in headers if key == name), None)


#: Limits on reading a refused body. A connection that is closed on unread bytes is reset, and the
#: client may lose the answer.
_LINGER_BYTES: Final = 64 * 2**20
_LINGER_S: Final = 20.0
_SILENCE_S: Final = 2.0

#: The size of a form without its scene: the spec and the boundaries.
ENVELOPE_BYTES: Final = 2 << 20

#: Where forms are read, into files.
_FORMS: Final = frozenset({"/v1/jobs", "/v1/scenes"})
#: Of a form, what never goes to the disk.
_MOST_IN_MEMORY: Final = 2**20
#: What uploads leave free of their disk, in bytes; a twentieth of a small one.
_ROOM: Final = 100_000_000
#: The largest body that is no upload; it is read into memory.
_MOST_OF_A_CHANGE: Final = 2**16


class OneLength(Layer):
    """Refuses a request with two body lengths, and a chunked one of HTTP/1.0.

    A proxy in front may believe the other length and see the next request where this API sees a
    body, or the reverse: request smuggling. RFC 9112, section 6, asks for a 400 and a closed
    connection.
    """

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on a request with one length."""
        names = {name for name, _ in scope["headers"]}
        in_chunks = b"transfer-encoding" in names
        if in_chunks and (b"content-length" in names or scope["http_version"] == "1.0"):
            await discard(receive)
            refusal = Problem(problems.TWO_LENGTHS)
            await refusal.response(scope["path"])(scope, receive, send)
        else:
            await self.app(scope, receive, send)


class BodyLimit(Layer):
    """Refuses a body of more than `most` bytes, by its announced length or while it streams.

    That limit is for forms; any other body is JSON and has a smaller one. A key may have a lower
    limit than the service.
    """

    def __init__(self, app: ASGIApp, most: int) -> None:
        super().__init__(app)
        self._most = most

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, counting the bytes of its body."""
        most, refusal = self._limit(scope)
        announced = header(scope["headers"], b"content-length")
        if announced is not None and announced.isdigit() and int(announced) > most:
            await discard(receive)
            await refusal.response(scope["path"])(scope, receive, send)
            return
        received = 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            is_too_long = received > most
            if is_too_long or (received > _MOST_IN_MEMORY and _is_nearly_full()):
                if message.get("more_body"):
                    await discard(receive)
                raise refusal if is_too_long else Problem(problems.NO_ROOM_FOR_UPLOADS)
            return message

        await self.app(scope, counted, send)

    def _limit(self, scope: Scope) -> tuple[int, Problem]:
        """The most bytes of the body, and the problem with more."""
        kind = (header(scope["headers"], b"content-type") or "").lower()
        if scope["path"] not in _FORMS:
            return _limited(problems.LARGE_CHANGE, _MOST_OF_A_CHANGE)
        if not kind.startswith("multipart/form-data"):
            wrong = Problem(problems.NOT_MULTIPART, media_type=kind.partition(";")[0] or "unnamed")
            return _MOST_OF_A_CHANGE, wrong
        caller: Caller = scope.get("state", {}).get("caller", ANYBODY)
        most = (caller.upload_bytes or self._most) + ENVELOPE_BYTES
        if most < self._most:
            return _limited(problems.LARGE_FOR_THE_KEY, most, key=caller.name)
        return _limited(problems.UPLOAD_TOO_LARGE, self._most)


def _is_nearly_full() -> bool:
    """Whether uploads have filled their disk so far that Redis and the blobs may soon lack room."""
    with contextlib.suppress(OSError):  # whoever writes there will hear of it
        disk = shutil.disk_usage(tempfile.gettempdir())
        return disk.free < min(_ROOM, disk.total // 20)
    return False


def _limited(kind: ProblemType, most: int, **fields: str) -> tuple[int, Problem]:
    return most, Problem(kind, limit_bytes=most, **fields)


async def discard_body(scope: Scope, receive: Receive) -> None:
    """Read the body of a refused request, if it has one, within the limits on lingering."""
    names = {name for name, _ in scope["headers"]}
    # A client that expects 100-continue sends no body after a refusal.
    if b"expect" not in names and names & {b"content-length", b"transfer-encoding"}:
        await discard(receive)


async def discard(receive: Receive) -> None:
    """Read the rest of a body, within the limits on lingering."""
    left, more, over = _LINGER_BYTES, True, time.monotonic() + _LINGER_S
    with contextlib.suppress(asyncio.TimeoutError):
        while more and left > 0 and time.monotonic() < over:
            message = await asyncio.wait_for(receive(), _SILENCE_S)
            left -= len(message.get("body", b""))
            more = message.get("more_body", False)
