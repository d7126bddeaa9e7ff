"""Child processes that do not outlive their parent."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1


def die_with_parent(signal_number: int = signal.SIGTERM) -> Callable[[], None]:
    """A ``preexec_fn``: the kernel sends the child this signal when its parent is gone.

    On Linux; elsewhere it does nothing and a parent that is killed outright leaves the child.
    The signal is tied to the thread that starts the child, so start it from one that stays.
    """
    if not sys.platform.startswith("linux"):
        return lambda: None
    parent, libc = os.getpid(), ctypes.CDLL(None, use_errno=True)

    def arrange() -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal_number)
        if os.getppid() != parent:  # it died before we asked
            os.kill(os.getpid(), signal_number)

    return arrange
