"""Who may ask a blob store that is silent: one at a time, so that not all wait for it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from plateau.farm.blobs.errors import is_silence


class Gate:
    """Around small requests: while a store is silent, one caller at a time asks it.

    The others are told at once. Without it every thread of an API that is asked for pictures would
    soon wait for the store, and none would be left for what needs no blob.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._is_silent = False
        self._is_asked = False

    @contextmanager
    def asking(self) -> Iterator[None]:
        """Let the caller ask, or raise `TimeoutError` where another does, and it was silent."""
        with self._lock:
            asks_for_all = self._is_silent
            if asks_for_all and self._is_asked:
                raise TimeoutError("it did not answer a moment ago")
            self._is_asked = asks_for_all
        is_silent = False
        try:
            yield
        except Exception as error:
            is_silent = is_silence(error)
            raise
        finally:
            with self._lock:
                self._is_silent = is_silent
                if asks_for_all:
                    self._is_asked = False
