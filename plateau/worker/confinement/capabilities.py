"""Drops root's capabilities: what is left of root is a user whose id is 0."""

import os
import struct
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from plateau.farm.process.lifecycle import c_call

# <linux/prctl.h>, <linux/capability.h>
_PR_CAPBSET_DROP: Final = 24
_PR_SET_NO_NEW_PRIVS: Final = 38
_PR_CAP_AMBIENT: Final = 47
_PR_CAP_AMBIENT_CLEAR_ALL: Final = 4
_CAPABILITY_VERSION_3: Final = 0x20080522
_READ_ANY_FILE: Final = 1 << 2  # CAP_DAC_READ_SEARCH


def drop_capabilities(needed: Path = Path(os.__file__)) -> None:
    """Give up every capability, for this thread and all that it starts, for good.

    The one to read any file is kept if nothing would run without it: if this Python lies in a
    folder that only its owner may enter (``sudo plateau worker`` with a user's Python). Landlock
    alone then decides what may be read.

    Parameters
    ----------
    needed : Path
        A file that has to stay readable; by default one of Python's own library.

    Raises
    ------
    OSError
        The kernel refuses.
    """
    if not sys.platform.startswith("linux") or not held():
        return
    # A program could regain these. Without CAP_SETPCAP the calls fail, which does no harm: programs
    # are refused, and would get no new privileges.
    last = int(Path("/proc/sys/kernel/cap_last_cap").read_text(encoding="utf-8"))
    with suppress(OSError):
        for capability in range(last + 1):
            c_call("prctl", _PR_CAPBSET_DROP, capability, 0, 0, 0)
    with suppress(OSError):
        c_call("prctl", _PR_CAP_AMBIENT, _PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0)
    kept = held() & _READ_ANY_FILE
    _use(0, of=kept)
    if _is_readable(needed):
        _use(0, of=0)
    else:
        _use(kept, of=kept)


def _use(effective: int, *, of: int) -> None:
    # struct __user_cap_header_struct {u32 version; int pid}; two of {effective, permitted,
    # inheritable}
    header = struct.pack("=Ii", _CAPABILITY_VERSION_3, 0)
    c_call("capset", header, struct.pack("=6I", effective, of, 0, 0, 0, 0))


def _is_readable(file: Path) -> bool:
    try:
        file.open("rb").close()
    except PermissionError:
        return False
    return True


def refuse_new_privileges() -> None:
    """Keep set-user-id programs powerless, for this thread and all that it starts, for good.

    Without this only root could apply a Landlock ruleset or a seccomp filter.

    Raises
    ------
    OSError
        The kernel refuses.
    """
    c_call("prctl", _PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)


def held() -> int:
    """Return the capabilities that this thread may use, one bit for each."""
    status = Path("/proc/thread-self/status").read_text(encoding="utf-8")
    permitted = next(line for line in status.splitlines() if line.startswith("CapPrm:"))
    return int(permitted.split()[1], 16)
