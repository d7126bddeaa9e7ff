"""A client that costs little itself: requests as bytes, one keep-alive connection for each caller.

A library's client would add its own time to the server's latency.
"""

from __future__ import annotations

import asyncio
import random
import time
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator, Mapping

#: A connection unused for longer is not used again, since the server may close it.
_KEPT_ALIVE_S = 3.0
_BOUNDARY = "a-part-of-the-benchmark"


@dataclass(frozen=True)
class Call:
    """A server's URL and the bytes of a request to it."""

    url: str
    request: bytes


class Connection:
    """One connection to a server, for one request at a time."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    @classmethod
    @asynccontextmanager
    async def to(cls, url: str) -> AsyncIterator[Connection]:
        """Open a connection for the context."""
        host, port = address(url)
        reader, writer = await asyncio.open_connection(host, port, limit=1 << 24)
        try:
            yield cls(reader, writer)
        finally:
            writer.close()
            await writer.wait_closed()

    async def answer(self, request: bytes) -> bytes:
        """Return the body of the answer; raise if its status is not 2xx."""
        self._writer.write(request)
        head = await self._reader.readuntil(b"\r\n\r\n")
        length = next(
            int(line.split(b":")[1])
            for line in head.lower().splitlines()
            if line.startswith(b"content-length:")
        )
        body = await self._reader.readexactly(length)
        if not head.split(b" ", 2)[1].startswith(b"2"):
            raise AssertionError(f"{request[:60]!r} was answered {head + body[:500]!r}")
        return body


def address(url: str) -> tuple[str, int]:
    """Return the host and the port of a URL that names both."""
    parts = urlsplit(url)
    if parts.hostname is None or parts.port is None:
        raise ValueError(f"{url} lacks a host or a port")
    return parts.hostname, parts.port


def get(path: str, accept: str = "application/json") -> bytes:
    """Return a GET."""
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: {accept}\r\n\r\n".encode()


def post_form(path: str, fields: Mapping[str, str], scene: bytes | None = None) -> bytes:
    """Return a POST of a form with these fields and, if given, the file `scene`."""
    start = f"--{_BOUNDARY}\r\nContent-Disposition: form-data; name="
    parts = [f'{start}"{name}"\r\n\r\n{value}\r\n'.encode() for name, value in fields.items()]
    if scene is not None:
        parts += [f'{start}"scene"; filename="a.xml"\r\n\r\n'.encode(), scene, b"\r\n"]
    body = b"".join([*parts, f"--{_BOUNDARY}--\r\n".encode()])
    head = (
        f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}\r\n"
        f"Content-Type: multipart/form-data; boundary={_BOUNDARY}\r\n\r\n"
    )
    return head.encode() + body


async def at_a_rate(
    calls: Mapping[str, Call], *, per_s: float, seconds: float
) -> dict[str, list[float]]:
    """Make each of these calls at random moments, at this rate; return latencies in seconds.

    A latency counts from the moment at which the request was due, so that a wait for another
    request counts, as it does for a user.
    """

    async def often(name: str, call: Call) -> list[float]:
        start = time.perf_counter()
        free: list[tuple[float, Connection]] = []  # with when each was last used

        async def once(due: float, closing: AsyncExitStack) -> float:
            await asyncio.sleep(start + due - time.perf_counter())
            used, connection = free.pop() if free else (0.0, None)
            if connection is None or time.perf_counter() - used > _KEPT_ALIVE_S:
                connection = await closing.enter_async_context(Connection.to(call.url))
            await connection.answer(call.request)
            free.append((time.perf_counter(), connection))
            return time.perf_counter() - start - due

        moments = random.Random(name)
        async with AsyncExitStack() as closing:
            due = [moments.uniform(0, seconds) for _ in range(round(per_s * seconds))]
            return list(await asyncio.gather(*(once(at, closing) for at in due)))

    found = await asyncio.gather(*(often(*item) for item in calls.items()))
    return dict(zip(calls, found, strict=True))


async def in_turn(calls: Mapping[str, Iterator[Call]], *, turns: int) -> dict[str, list[float]]:
    """Make each of these calls in turn, this many times; return latencies in seconds."""
    found: dict[str, list[float]] = {name: [] for name in calls}
    async with AsyncExitStack() as closing:
        connections: dict[str, Connection] = {}
        for _ in range(turns):
            for name, ones in calls.items():
                call = next(ones)
                if call.url not in connections:
                    connections[call.url] = await closing.enter_async_context(
                        Connection.to(call.url)
                    )
                started = time.perf_counter()
                await connections[call.url].answer(call.request)
                found[name].append(time.perf_counter() - started)
    return found


async def at_once(calls: Iterator[Call], *, callers: int, turns: int) -> float:
    """Return the answers a second when this many callers each make `turns` calls."""

    async def caller(first: Call) -> None:
        async with Connection.to(first.url) as connection:
            await connection.answer(first.request)
            for _ in range(turns - 1):
                await connection.answer(next(calls).request)

    started = time.perf_counter()
    await asyncio.gather(*(caller(next(calls)) for _ in range(callers)))
    return callers * turns / (time.perf_counter() - started)
