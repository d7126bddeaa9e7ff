"""Takes root's powers away: what is left of root is a user whose id is 0."""

import ctypes
import os
import struct
import sys
from pathlib import Path
from typing import Final

# <linux/prctl.h>, <linux/capability.h>
_PR_CAPBSET_DROP: Final = 24
_PR_CAP_AMBIENT: Final = 47
_PR_CAP_AMBIENT_CLEAR_ALL: Final = 4
_CAPABILITY_VERSION_3: Final = 0x20080522


def drop_capabilities() -> None:
    """Give up every capability, for this thread and all that it starts, for good.

    Raises
    ------
    OSError
        The kernel refuses.
    """
    if not sys.platform.startswith("linux") or not held():
        return
    libc = ctypes.CDLL(None, use_errno=True)
    # What a program could get back. Without CAP_SETPCAP this fails, and nothing is lost: programs
    # are refused, and would have no new privileges.
    for capability in range(int(Path("/proc/sys/kernel/cap_last_cap").read_text()) + 1):
        libc.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0)
    libc.prctl(_PR_CAP_AMBIENT, _PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0)
    # struct __user_cap_header_struct {u32 version; int pid}; two of {effective, permitted,
    # inheritable}
    header = struct.pack("=Ii", _CAPABILITY_VERSION_3, 0)
    if libc.capset(header, struct.pack("=6I", *[0] * 6)) != 0:
        code = ctypes.get_errno()
        raise OSError(code, f"capset: {os.strerror(code)}")


def held() -> int:
    """Return the capabilities that this thread may use, a bit each."""
    status = Path("/proc/thread-self/status").read_text()
    permitted = next(line for line in status.splitlines() if line.startswith("CapPrm:"))
    return int(permitted.split()[1], 16)
