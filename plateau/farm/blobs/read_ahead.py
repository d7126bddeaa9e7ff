"""Blobs that are read before their turn, several at a time, where the store is slow.

A store over a network takes tens of milliseconds for each blob, however many it is asked for at
once. A folder on a disk of this machine takes less than handing a read to another thread.
"""

import time
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from plateau.farm.blobs.store import Blobs

#: Reads under way at once, in all series.
THREADS: Final = 8
#: A store of which each of the last reads took longer is slow.
SLOW_S: Final = 0.002
_LAST: Final = 4
#: Blobs of a series that are begun before their turn, and the bytes of all series.
MOST: Final = 2 * THREADS
MOST_BYTES: Final = 128_000_000


class ReadAhead:
    """The threads that read, for all series of one thread."""

    def __init__(self, store: Blobs) -> None:
        self._store = store
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="read-ahead")
        self._took_s: deque[float] = deque(maxlen=_LAST)
        self._held = 0  # bytes of what is begun and not yet asked for, as far as known

    def series(self) -> "Series":
        """Return an empty series."""
        return Series(self)

    def close(self) -> None:
        """Begin no more reads."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def read(self, name: str) -> bytes:
        """Return a blob; raises as `Blobs.get`."""
        began = time.monotonic()
        try:
            return self._store.get(name)
        finally:
            self._took_s.append(time.monotonic() - began)

    def begin(self, name: str, size: int) -> "Future[bytes] | None":
        """Begin to read a blob of about this size, if that is worth it and there is room."""
        is_slow = len(self._took_s) == _LAST and min(self._took_s) > SLOW_S
        if not is_slow or self._held + size > MOST_BYTES:
            return None
        self._held += size
        return self._threads.submit(self.read, name)

    def result(self, begun: "Future[bytes]", size: int) -> bytes:
        """Return what was begun with this size; raises as `Blobs.get`."""
        self._held -= size
        return self._store.result_of(begun)

    def drop(self, begun: "Future[bytes]", size: int) -> None:
        """Forget what was begun with this size."""
        begun.cancel()
        self._held -= size


class Series:
    """Blobs of about the same size that are asked for one after another."""

    def __init__(self, ahead: ReadAhead) -> None:
        self._ahead = ahead
        self._coming: deque[str] = deque()
        self._begun: dict[str, tuple[Future[bytes], int]] = {}
        self._size = 0  # of the last one in bytes; 0 before it is known

    def expect(self, names: Iterable[str]) -> None:
        """Say which blobs come next, in their order, instead of those that were expected."""
        self.let_go()
        self._coming = deque(names)

    def get(self, name: str) -> bytes:
        """Return a blob; raises as `Blobs.get`."""
        begun = self._begun.pop(name, None)
        if begun is None and name in self._coming:
            self._coming.remove(name)
        self._begin()
        content = self._ahead.read(name) if begun is None else self._ahead.result(*begun)
        self._size = len(content)
        return content

    def let_go(self) -> None:
        """Keep nothing in memory; what is expected still is, and will be read again."""
        self._coming.extendleft(reversed(self._begun))
        for begun in self._begun.values():
            self._ahead.drop(*begun)
        self._begun = {}

    def _begin(self) -> None:
        while self._size and self._coming and len(self._begun) < MOST:
            begun = self._ahead.begin(self._coming[0], self._size)
            if begun is None:
                return
            self._begun[self._coming.popleft()] = begun, self._size
