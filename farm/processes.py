"""Processes that others look after: a sign of life, and children that end with their parent."""

import contextlib
import ctypes
import logging
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

_LOG = logging.getLogger(__name__)

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


def forget_life(file: Path | None) -> None:
    """Remove the sign of life of a process that was here before this one."""
    if file is not None:
        with contextlib.suppress(OSError):
            file.unlink()


def show_life(file: Path | None) -> None:
    """Touch the file by which others see that this process goes on, where they asked for one."""
    if file is None:
        return
    try:
        file.touch()
    except OSError as error:
        _LOG.warning("no sign of life: %s", error)
