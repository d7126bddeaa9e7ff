"""Notices a thread that waits for a disk, a network mount or a device that does not answer.

No signal ends such a wait, so the thread can do nothing about it. Another one can let others have
its work.
"""

import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

#: A thread that has been in one wait for so long hangs. A sync of a busy disk may take ten seconds.
HUNG_S: Final = 30.0
#: What is wrong with it, in words.
HANGS: Final = "it waits for a disk, a network mount or a device that does not answer"


class Hang:
    """Watches a thread of this process from another one. It sees nothing but on Linux.

    Parameters
    ----------
    thread : threading.Thread
        It has started.
    """

    def __init__(self, thread: threading.Thread) -> None:
        self._status = Path(f"/proc/self/task/{thread.native_id}/status")
        self._wait: str | None = None  # the one that was seen last, by its number
        self._since_s = 0.0

    def is_seen(self) -> bool:
        """Return whether the thread hangs; it takes two calls in one wait to see that."""
        wait = self._uninterruptible_wait()
        if wait is None or wait != self._wait:
            self._wait, self._since_s = wait, time.monotonic()
        return wait is not None and time.monotonic() > self._since_s + HUNG_S

    def _uninterruptible_wait(self) -> str | None:
        """Return the number of the thread's wait, if it is in one that no signal ends."""
        with suppress(OSError):
            lines = self._status.read_text().splitlines()
            told = dict(line.split(":", 1) for line in lines)
            if told["State"].split()[0] == "D":
                return told["voluntary_ctxt_switches"].strip()
        return None
