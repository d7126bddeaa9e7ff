"""Supervised and confined processes.

Signs of life, children that end with their parent, resource limits, protected memory, and the
functions of the C library that Python lacks.
"""

import contextlib
import ctypes
import errno
import logging
import os
import resource
import secrets
import signal
import socket
import sys
from collections.abc import Callable
from pathlib import Path

_LOG = logging.getLogger(__name__)

#: The environment of a process that may know no secrets, neither Plateau's nor a cloud's.
_PLAIN = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "VIRTUAL_ENV", "LD_LIBRARY_PATH")

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4


def c_call(function: str, *arguments: object, what: str = "") -> int:
    """Call the function; `OSError`, which calls it `what`, where its answer is negative."""
    libc = ctypes.CDLL(None, use_errno=True)
    answer: int = getattr(libc, function)(*arguments)
    if answer < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"{what or function}: {os.strerror(code)}")
    return answer


def process_id() -> str:
    """A unique id for this process: its machine, its process id, and a random part."""
    return f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"


def how_ended(status: int) -> str:
    """In words, how a process with this return code ended."""
    return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"exited with {status}"


def die_with_parent(signal_number: int = signal.SIGTERM) -> Callable[[], None]:
    """A ``preexec_fn``: the kernel sends the child this signal when its parent is gone.

    On Linux; elsewhere it does nothing, and the child of a killed parent lives on. The signal comes
    when the thread that started the child ends, so start it from a thread that stays.
    """
    if not sys.platform.startswith("linux"):
        return lambda: None
    parent, c_library = os.getpid(), ctypes.CDLL(None)  # loaded before there is a child

    def arrange() -> None:
        if signal_number != signal.SIGKILL:  # a handler of the parent's would only note it
            signal.signal(signal_number, signal.SIG_DFL)
        c_library.prctl(_PR_SET_PDEATHSIG, signal_number)
        if os.getppid() != parent:  # it died before we asked
            os.kill(os.getpid(), signal_number)

    return arrange


def plain_environment() -> dict[str, str]:
    """Return this process's environment without credentials for Redis or the blob store.

    NumPy's BLAS has one thread: each reserves memory, and a child whose memory is limited could not
    import NumPy on a machine with 16 cores. No child multiplies matrices.
    """
    kept = {name: os.environ[name] for name in _PLAIN if name in os.environ}
    return kept | {"OPENBLAS_NUM_THREADS": "1"}


def limit(kind: int, most: int) -> None:
    """Limit this process's use of a resource (``RLIMIT_…``), irrevocably."""
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


def shut_memory() -> None:
    """Keep other processes of this user from this one's memory, environment and open files.

    They have credentials. This also prevents a core dump. Root still has access; and a program
    started from here is not protected.

    Raises
    ------
    OSError
        This system cannot do it, or refuses it.
    """
    if not sys.platform.startswith("linux"):
        raise OSError(errno.ENOSYS, f"there is no way to on {sys.platform}")
    c_call("prctl", _PR_SET_DUMPABLE, 0, 0, 0, 0)


def forget_life(file: Path | None) -> None:
    """Remove the sign of life of an earlier process."""
    if file is not None:
        with contextlib.suppress(OSError):
            file.unlink()


def show_life(file: Path | None, trouble: str | None = None) -> None:
    """Touch the file by which probes see that this process lives, if one is set.

    The file says why the process takes no work, and is empty while it does.
    """
    if file is None:
        return
    words = trouble or ""
    try:
        file.touch()
        if file.read_text(encoding="utf-8") != words:
            file.write_text(words, encoding="utf-8")
    except OSError as error:
        _LOG.warning("no sign of life: %s", error)
