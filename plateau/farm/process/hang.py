"""Notices a thread that waits for a disk, a network mount or a device that does not answer.

No signal ends such a wait, so the thread can do nothing. Another one can let others have its work.
"""

import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

from plateau.farm.process import disk_probe
from plateau.farm.process.child import HANGS, start

#: A thread that has been in one wait for so long hangs. A sync of a busy disk may take ten seconds.
HUNG_S: Final = 30.0

#: Share of `HUNG_S` after which a folder is tested; the test has to hang for as long.
_DOUBT: Final = 1 / 3


class DiskTest:
    """Tests by a small file whether a folder's disk answers.

    In a process of its own, which may hang: one at a time, since a signal might not end it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writing: subprocess.Popen[bytes] | None = None
        self._since_s = 0.0

    def trouble(self, within_s: float) -> str | None:
        """Return why no file can be written, or None; wait for so long at most.

        Raises
        ------
        OSError
            There can be no other process.
        """
        writing = self._writing or self._begin()
        try:
            _, words = writing.communicate(timeout=within_s)
        except subprocess.TimeoutExpired:
            return f"cannot write into {self._folder}: {HANGS}"
        self._writing = None
        if writing.returncode == 0:
            return None
        return words.decode(errors="replace").strip() or f"cannot write into {self._folder}"

    def hangs(self, after_s: float, *, begin: bool) -> bool:
        """Return at once whether a test runs for longer than this; if none runs, `begin` one."""
        writing = self._writing or (self._begin() if begin else None)
        if writing is None:
            return False
        if writing.poll() is not None:
            writing.communicate()
            self._writing = None
            return False
        return time.monotonic() > self._since_s + after_s

    def _begin(self) -> subprocess.Popen[bytes]:
        self._since_s = time.monotonic()
        self._writing = start(
            disk_probe.__name__, self._folder, user_site=False, stderr=subprocess.PIPE
        )
        return self._writing


class Store(Protocol):
    """A blob store, as `Hang` sees it."""

    @property
    def scratch(self) -> Path | None:
        """The folder for half-written blobs; None where the blobs are no files."""

    def called_since(self, thread: int) -> float | None:
        """Return since when a thread, by its identity, waits for the store, as `monotonic` does."""


class Hang:
    """Watches a thread of this process from another one. It sees nothing but on Linux.

    Parameters
    ----------
    thread : threading.Thread
        It has started.
    store : Store
        The blob store, for which other threads than the watched one may wait in its place, and
        where a wait may be one that signals end (FUSE). A store that is only slow answers a test.
    """

    def __init__(self, thread: threading.Thread, store: Store) -> None:
        self._status = Path(f"/proc/self/task/{thread.native_id}/status")
        self._wait: str | None = None  # the one that was seen last, by its number
        self._since_s = 0.0
        self._thread = thread
        self._store = store
        self._test = None if store.scratch is None else DiskTest(store.scratch)

    def is_seen(self) -> bool:
        """Return whether the thread hangs; it takes two calls in one wait to see that."""
        wait = self._uninterruptible_wait()
        if wait is None or wait != self._wait:
            self._wait, self._since_s = wait, time.monotonic()
        in_the_kernel = wait is not None and time.monotonic() > self._since_s + HUNG_S
        return in_the_kernel or self._store_is_silent()

    def _store_is_silent(self) -> bool:
        if self._test is None:
            return False
        called_s = self._store.called_since(self._thread.ident or 0)
        waits_s = 0.0 if called_s is None else time.monotonic() - called_s
        doubt_s = HUNG_S * _DOUBT
        with suppress(OSError):  # there can be no other process, and nothing is known
            return self._test.hangs(doubt_s, begin=waits_s > doubt_s) and waits_s > HUNG_S
        return False

    def _uninterruptible_wait(self) -> str | None:
        """Return the number of the thread's wait, if it is in one that no signal ends."""
        with suppress(OSError):
            lines = self._status.read_text(encoding="utf-8").splitlines()
            told = dict(line.split(":", 1) for line in lines)
            if told["State"].split()[0] == "D":
                return told["voluntary_ctxt_switches"].strip()
        return None
