"""Many watchers of one stream of events, and when each event reached the first and the last.

    python -m bench.support.load.watchers URL PATH COUNT

Prints `ready` when all are connected; at the end of its input it prints a JSON list with a
`Received` for each event.
"""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import sys
import time
from dataclasses import asdict, dataclass

from bench import ROOT
from bench.support.load.http_load import address, get

#: How long after the end an earlier event may still arrive.
_PATIENCE_S = 15.0
_EVENT = re.compile(rb"id: (\d+)-(\d+)\nevent: (\w+)\n")


@dataclass(kw_only=True)
class Received:
    """An event and its arrival; times are those of `time.time`."""

    type: str
    at: float  #: when it was written, by its id
    first: float  #: at the first watcher
    last: float  #: at the last watcher so far
    receivers: int


class Watchers:
    """Watchers of a stream, in a process of their own, while the context lasts."""

    def __init__(self, url: str, path: str, count: int) -> None:
        self._count = count
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.support.load.watchers", url, path, str(count)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.received: list[Received] = []  #: of each point, once the context is left

    def __enter__(self) -> Watchers:
        if self._process.stdout is None or self._process.stdout.readline() != "ready\n":
            raise AssertionError("the watchers were not let in")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        said = self._process.communicate()[0]
        if kind is None:
            if self._process.returncode:
                raise AssertionError("the watchers ended early")
            self.received = self._checked([Received(**one) for one in json.loads(said)])

    def _checked(self, received: list[Received]) -> list[Received]:
        """Return the points; raise if a watcher lacks an event."""
        for one in received:
            if one.receivers != self._count:
                raise AssertionError(f"{one.receivers} of {self._count} received {one}")
        return [one for one in received if one.type == "point"]


class _Watcher(asyncio.Protocol):
    """One connection, which reads as little of each event as possible."""

    def __init__(self, request: bytes, events: dict[tuple[int, int], Received]) -> None:
        self._request = request
        self._events = events
        self._left = b""
        self._newest = (0, 0)
        self.let_in = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        transport.write(self._request)  # type: ignore[attr-defined]  # a plain socket's is a duplex

    def data_received(self, data: bytes) -> None:
        now = time.time()
        if not self.let_in.done():
            self.let_in.set_result(data.startswith(b"HTTP/1.1 200"))
        data = self._left + data
        whole = data.rfind(b"\n\n") + 2
        self._left = data[whole:] if whole > 1 else data
        for ms, number, kind in _EVENT.findall(data, 0, max(whole, 0)):
            event_id = int(ms), int(number)
            if event_id <= self._newest:
                raise AssertionError(f"event {event_id} came after {self._newest}")
            self._newest = event_id
            one = self._events.get(event_id)
            if one is None:
                self._events[event_id] = Received(
                    type=kind.decode(), at=int(ms) / 1000, first=now, last=now, receivers=1
                )
            else:
                one.last = now
                one.receivers += 1


async def _watch(url: str, path: str, count: int) -> None:
    host, port = address(url)
    loop = asyncio.get_running_loop()
    events: dict[tuple[int, int], Received] = {}
    request = get(f"{path}?after={round(time.time() * 1000)}-0", "text/event-stream")
    watchers = [
        (await loop.create_connection(lambda: _Watcher(request, events), host, port))[1]
        for _ in range(count)
    ]
    if not all(await asyncio.gather(*(watcher.let_in for watcher in watchers))):
        raise SystemExit("a watcher was refused")
    everyone_since = time.time()
    print("ready", flush=True)
    await loop.run_in_executor(None, sys.stdin.read)
    ended = time.time()
    while True:
        watched = [one for one in events.values() if everyone_since < one.at < ended]
        on_its_way = any(one.receivers < count for one in watched)
        if not on_its_way or time.time() > ended + _PATIENCE_S:
            break
        await asyncio.sleep(0.05)
    json.dump([asdict(one) for one in watched], sys.stdout)


if __name__ == "__main__":
    asyncio.run(_watch(sys.argv[1], sys.argv[2], int(sys.argv[3])))
