"""The newest events of a job, kept once for all its watchers."""

import asyncio
import contextlib
import json
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

from plateau.farm.model.job import Event

#: Events kept for each job; a watcher that is further behind reads Redis itself.
_KEPT: Final = 256

#: Watchers woken before other tasks have their turn: writing to hundreds takes tens of ms.
_WOKEN_AT_ONCE: Final = 20


def position(event_id: str) -> tuple[int, int]:
    """An event's id as numbers, which sort as the events do."""
    ms, _, number = event_id.partition("-")
    return int(ms), int(number)


@dataclass(frozen=True)
class Told:
    """An event as the watchers receive it."""

    position: tuple[int, int]
    is_last: bool
    frame: bytes  #: of a Server-Sent Events stream; its data include the event's time as ``at``

    @classmethod
    def of(cls, event: Event) -> "Told":
        """Encode the event."""
        data = json.dumps({"at": event.at.isoformat(), **event.data})
        frame = f"id: {event.id}\nevent: {event.type}\ndata: {data}\n\n"
        return cls(position(event.id), event.type == "finished", frame.encode())


class Watcher:
    """A client of a feed, which waits for its news."""

    def __init__(self) -> None:
        self._news = asyncio.Event()

    def wake(self) -> None:
        """Announce news."""
        self._news.set()

    def has_seen_all(self) -> None:
        """Forget the news that were announced until now."""
        self._news.clear()

    async def has_news(self, *, within_s: float) -> bool:
        """Wait for news; False if none came in this time."""
        loop = asyncio.get_running_loop()
        in_time = True

        def give_up() -> None:
            nonlocal in_time
            in_time = False
            self._news.set()

        # A timer costs a fraction of `asyncio.wait_for`, and hundreds wait at a time.
        timer = loop.call_later(within_s, give_up)
        try:
            await self._news.wait()
        finally:
            timer.cancel()
        return in_time


class Feed:
    """The events that one reader reads in Redis for all watchers of a job."""

    def __init__(self) -> None:
        self._reader: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._watchers: set[Watcher] = set()
        self._recent: deque[Told] = deque()
        self._complete_since: tuple[int, int] | None = None  # `_recent` has all later events

    @property
    def is_watched(self) -> bool:
        """Whether the job has watchers."""
        return bool(self._watchers)

    def read_by(self, reader: "asyncio.Task[None]") -> None:
        """Set the task that adds the events; it never ends by itself."""
        self._reader = reader
        reader.add_done_callback(lambda _: self.wake_all())

    def check(self) -> None:
        """Raise the reader's error if it died."""
        if self._reader.done():
            self._reader.result()

    def stop(self) -> "asyncio.Future[None]":
        """Stop the reader; returns its future."""
        self._reader.cancel()
        return self._reader

    @contextlib.contextmanager
    def watcher(self) -> Iterator[Watcher]:
        """Add a watcher while the context lasts."""
        watcher = Watcher()
        self._watchers.add(watcher)
        try:
            yield watcher
        finally:
            self._watchers.discard(watcher)

    def since(self, known: tuple[int, int]) -> tuple[Told, ...] | None:
        """The events after that position; None if the feed does not reach back so far."""
        if self._complete_since is None or known < self._complete_since:
            return None
        newer = takewhile(lambda one: one.position > known, reversed(self._recent))
        return tuple(reversed(tuple(newer)))

    async def start(self, newest: tuple[int, int]) -> None:
        """Keep the events after this position, the newest one's."""
        self._complete_since = newest
        await self._wake_in_turn()

    async def add(self, told: list[Told]) -> None:
        """Keep the next events, and wake all watchers."""
        self._recent.extend(told)
        while len(self._recent) > _KEPT:
            self._complete_since = self._recent.popleft().position
        await self._wake_in_turn()

    def wake_all(self) -> None:
        """Wake all watchers at once."""
        for watcher in self._watchers:
            watcher.wake()

    async def _wake_in_turn(self) -> None:
        for number, watcher in enumerate(tuple(self._watchers)):
            if number and number % _WOKEN_AT_ONCE == 0:
                await asyncio.sleep(0)
            watcher.wake()
