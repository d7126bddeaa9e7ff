"""Processes that others look after, and may not look into.

A sign of life, children that end with their parent, bounds, and memory that is shut.
"""

import contextlib
import ctypes
import errno
import logging
import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path

from plateau.farm.process import libc

_LOG = logging.getLogger(__name__)

#: What a process needs of the environment that keeps no secrets of Plateau's, or of the cloud's.
_PLAIN = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "VIRTUAL_ENV", "LD_LIBRARY_PATH")

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4


def die_with_parent(signal_number: int = signal.SIGTERM) -> Callable[[], None]:
    """A ``preexec_fn``: the kernel sends the child this signal when its parent is gone.

    On Linux; elsewhere it does nothing and a parent that is killed outright leaves the child.
    The signal is tied to the thread that starts the child, so start it from one that stays.
    """
    if not sys.platform.startswith("linux"):
        return lambda: None
    parent, c_library = os.getpid(), ctypes.CDLL(None)  # loaded before there is a child

    def arrange() -> None:
        c_library.prctl(_PR_SET_PDEATHSIG, signal_number)
        if os.getppid() != parent:  # it died before we asked
            os.kill(os.getpid(), signal_number)

    return arrange


def plain_environment() -> dict[str, str]:
    """Return this process's environment without credentials: nothing of Redis or the blob store."""
    return {name: os.environ[name] for name in _PLAIN if name in os.environ}


def limit(kind: int, most: int) -> None:
    """Bound what this process may take of a resource (``RLIMIT_…``), from now on and for good."""
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


def shut_memory() -> None:
    """Keep other processes of this user from this one's memory, environment and open files.

    Credentials are there. It leaves no core dump either. Who is root still gets in; and a program
    that is started from here begins with its memory open.

    Raises
    ------
    OSError
        This system has no such thing, or refuses it.
    """
    if not sys.platform.startswith("linux"):
        raise OSError(errno.ENOSYS, f"there is no way to on {sys.platform}")
    libc.call("prctl", _PR_SET_DUMPABLE, 0, 0, 0, 0)


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
