"""The newest events of a job, kept once for all who watch it."""

import asyncio
import contextlib
import json
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

from plateau.farm.model.job import Event

#: Events of a job that are kept for who is late; before them, each reads Redis by itself.
_KEPT: Final = 256

#: So many watchers are woken, then whatever else waits has its turn: to write to all of hundreds
#: takes tens of milliseconds.
_WOKEN_AT_ONCE: Final = 20


def position(event_id: str) -> tuple[int, int]:
    """Where an event stands among the others: its id, as one compares it."""
    ms, _, number = event_id.partition("-")
    return int(ms), int(number)


def frame(event: Event) -> str:
    """The event as a frame of a Server-Sent Events stream; its data has its time as ``at``."""
    data = json.dumps({"at": event.at.isoformat(), **event.data})
    return f"id: {event.id}\nevent: {event.type}\ndata: {data}\n\n"


@dataclass(frozen=True)
class Told:
    """An event as it goes to each watcher."""

    position: tuple[int, int]
    is_last: bool
    frame: bytes

    @classmethod
    def of(cls, event: Event) -> "Told":
        """This event."""
        return cls(position(event.id), event.type == "finished", frame(event).encode())


class Watcher:
    """One who watches a feed, and waits for its news."""

    def __init__(self) -> None:
        self._news = asyncio.Event()

    def wake(self) -> None:
        """Say that there is news."""
        self._news.set()

    def has_seen_all(self) -> None:
        """Say that what was told until now is no news any more."""
        self._news.clear()

    async def has_news(self, *, within_s: float) -> bool:
        """Wait for news; False where none came in this time."""
        loop = asyncio.get_running_loop()
        in_time = True

        def give_up() -> None:
            nonlocal in_time
            in_time = False
            self._news.set()

        # Hundreds wait at a time: a timer is a fraction of what `asyncio.wait_for` costs.
        timer = loop.call_later(within_s, give_up)
        try:
            await self._news.wait()
        finally:
            timer.cancel()
        return in_time


class Feed:
    """A job that somebody watches: what one reader reads in Redis, for all of them."""

    def __init__(self) -> None:
        self._reader: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._watchers: set[Watcher] = set()
        self._recent: deque[Told] = deque()
        self._complete_since: tuple[int, int] | None = None  # what came later is in `_recent`

    @property
    def is_watched(self) -> bool:
        """Whether anybody watches it."""
        return bool(self._watchers)

    def read_by(self, reader: "asyncio.Task[None]") -> None:
        """Have a task for a reader, which is to add what happens, and never to end by itself."""
        self._reader = reader
        reader.add_done_callback(lambda _: self.wake_all())

    def check(self) -> None:
        """Raise what the reader died of, where it did."""
        if self._reader.done():
            self._reader.result()

    def stop(self) -> "asyncio.Future[None]":
        """Stop the reader; returns what ends with it."""
        self._reader.cancel()
        return self._reader

    @contextlib.contextmanager
    def watcher(self) -> Iterator[Watcher]:
        """One more who watches it, while the context lasts."""
        watcher = Watcher()
        self._watchers.add(watcher)
        try:
            yield watcher
        finally:
            self._watchers.discard(watcher)

    def since(self, known: tuple[int, int]) -> tuple[Told, ...] | None:
        """The events after that position; None where the feed does not reach back so far."""
        if self._complete_since is None or known < self._complete_since:
            return None
        newer = takewhile(lambda one: one.position > known, reversed(self._recent))
        return tuple(reversed(tuple(newer)))

    async def start(self, newest: tuple[int, int]) -> None:
        """Keep what is added from now on; this is the position of the event before."""
        self._complete_since = newest
        await self._wake_in_turn()

    async def add(self, told: list[Told]) -> None:
        """Keep the next events, and wake all who watch."""
        self._recent.extend(told)
        while len(self._recent) > _KEPT:
            self._complete_since = self._recent.popleft().position
        await self._wake_in_turn()

    def wake_all(self) -> None:
        """Wake all who watch, at once."""
        for watcher in self._watchers:
            watcher.wake()

    async def _wake_in_turn(self) -> None:
        for number, watcher in enumerate(tuple(self._watchers)):
            if number and number % _WOKEN_AT_ONCE == 0:
                await asyncio.sleep(0)
            watcher.wake()
