"""Blobs that are read and decoded before their turn, several at a time, where that takes long.

A store over a network takes tens of milliseconds for each blob, however many it is asked for at
once, and so does the decoding of a large film. A small one from a disk of this machine takes less
than handing it to another thread.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final, Generic, TypeVar

from plateau.farm.blobs.store import Blobs

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")

#: Reads under way at once, in all series.
THREADS: Final = 8
#: Reads are slow where each of the last ones took longer.
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

    def close(self) -> None:
        """Begin no more reads."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def read(self, read: Callable[[_Key], _Value], key: _Key) -> _Value:
        """Return what `read` returns for the key."""
        began = time.monotonic()
        try:
            return read(key)
        finally:
            self._took_s.append(time.monotonic() - began)

    def begin(
        self, read: Callable[[_Key], _Value], key: _Key, size: int
    ) -> "Future[_Value] | None":
        """Begin to read what has about this size, if that is worth it and there is room."""
        is_slow = len(self._took_s) == _LAST and min(self._took_s) > SLOW_S
        if not is_slow or self._held + size > MOST_BYTES:
            return None
        self._held += size
        return self._threads.submit(self.read, read, key)

    def result(self, begun: "Future[_Value]", size: int) -> _Value:
        """Return what was begun with this size; raises as what reads it."""
        self._held -= size
        return self._store.result_of(begun)

    def drop(self, begun: "Future[_Value]", size: int) -> None:
        """Forget what was begun with this size."""
        begun.cancel()
        self._held -= size


class Series(Generic[_Key, _Value]):
    """What is read for one key after another, and is about as large each time.

    Parameters
    ----------
    ahead
        The threads.
    read
        Returns what a key stands for; it may be called in any of the threads.
    size_of
        Returns its number of bytes.
    """

    def __init__(
        self,
        ahead: ReadAhead,
        read: Callable[[_Key], _Value],
        size_of: Callable[[_Value], int],
    ) -> None:
        self._ahead = ahead
        self._read = read
        self._size_of = size_of
        self._coming: deque[_Key] = deque()
        self._begun: dict[_Key, tuple[Future[_Value], int]] = {}
        self._size = 0  # of the last one in bytes; 0 before it is known

    def expect(self, keys: Iterable[_Key]) -> None:
        """Say which keys come next, in their order, instead of those that were expected."""
        self.let_go()
        self._coming = deque(keys)

    def get(self, key: _Key) -> _Value:
        """Return what the key stands for; raises as what reads it."""
        begun = self._begun.pop(key, None)
        if begun is None and key in self._coming:
            self._coming.remove(key)
        self._begin()
        value = self._ahead.read(self._read, key) if begun is None else self._ahead.result(*begun)
        self._size = self._size_of(value)
        return value

    def let_go(self) -> None:
        """Keep nothing in memory; what is expected still is, and will be read again."""
        self._coming.extendleft(reversed(self._begun))
        for begun in self._begun.values():
            self._ahead.drop(*begun)
        self._begun = {}

    def _begin(self) -> None:
        while self._size and self._coming and len(self._begun) < MOST:
            begun = self._ahead.begin(self._read, self._coming[0], self._size)
            if begun is None:
                return
            self._begun[self._coming.popleft()] = begun, self._size
