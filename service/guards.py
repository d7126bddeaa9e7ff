"""What is checked of a request before any route sees it: where it comes from, and its size."""

import asyncio
import contextlib
import ipaddress
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems import FOREIGN_HOST, FOREIGN_ORIGIN, UPLOAD_TOO_LARGE, Problem


def is_loopback(host: str) -> bool:
    """Whether this name or address, without a port, can only mean this machine."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


class LocalOnly:
    """Lets through requests that name this machine and come from no other web site.

    The API has no keys yet, so it listens on loopback only. A web page elsewhere can still make
    a browser on this machine call it: under a name that it controls and points at 127.0.0.1 (DNS
    rebinding; seen in ``Host``), or by a form that posts across sites (seen in ``Origin``).
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a foreign request with a problem; pass on any other."""
        problem = _foreign(scope["headers"]) if scope["type"] == "http" else None
        if problem is not None:
            await problem.response(scope["path"])(scope, receive, send)
        else:
            await self._app(scope, receive, send)


def _foreign(headers: Iterable[tuple[bytes, bytes]]) -> Problem | None:
    host = _header(headers, b"host") or ""
    if not is_loopback(_name_of(f"//{host}")):
        return Problem(
            FOREIGN_HOST,
            f"the request is addressed to {host!r}; this API has no keys yet and "
            "answers only as localhost, 127.0.0.1 or [::1]",
        )
    origin = _header(headers, b"origin")
    if origin is not None and origin.lower() != f"http://{host}".lower():
        return Problem(
            FOREIGN_ORIGIN, f"a page of {origin!r} made this request; only the API's own pages may"
        )
    return None


def _header(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> str | None:
    return next((value.decode("latin-1") for key, value in headers if key == name), None)


def _name_of(url: str) -> str:
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


#: So much of a refused body is still read, and for so long, before the connection is closed: closed
#: on bytes that nobody has read, it would take the answer with it.
_LINGER_BYTES = 64 * 2**20
_LINGER_S = 2.0


#: A body that is no upload is read into memory, so it may have so many bytes at most.
_MOST_OF_A_CHANGE = 2**16


class BodyLimit:
    """Refuses a body of more than `most` bytes, by its announced length or while it streams.

    Only a POST may bring so many: any other body is some JSON.
    """

    def __init__(self, app: ASGIApp, most: int) -> None:
        self._app = app
        self._most = most

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, counting the bytes of its body."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        most = self._most if scope["method"] == "POST" else _MOST_OF_A_CHANGE
        announced = _header(scope["headers"], b"content-length")
        if announced is not None and announced.isdigit() and int(announced) > most:
            await _discard(receive)
            await _too_large(most).response(scope["path"])(scope, receive, send)
            return
        received = 0

        async def counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > most:
                if message.get("more_body"):
                    await _discard(receive)
                raise _too_large(most)
            return message

        await self._app(scope, counted, send)


def _too_large(most: int) -> Problem:
    setting = "" if most == _MOST_OF_A_CHANGE else "; PLATEAU_MAX_UPLOAD_GB sets the limit"
    return Problem(
        UPLOAD_TOO_LARGE,
        f"the request has more than {most:,} bytes{setting}",
        headers={"Connection": "close"},
        limit_bytes=most,
    )


async def _discard(receive: Receive) -> None:
    """Read the rest of a body, as far and as long as is worth it."""

    async def read() -> None:
        left, more = _LINGER_BYTES, True
        while more and left > 0:
            message = await receive()
            left -= len(message.get("body", b""))
            more = message.get("more_body", False)

    with contextlib.suppress(asyncio.TimeoutError):
        await asyncio.wait_for(read(), _LINGER_S)
