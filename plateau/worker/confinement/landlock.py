"""Landlock, the kernel's own sandbox for files: from now on nothing but these paths can be opened.

A ruleset needs no privilege and binds root too. It holds, for good, for the thread that applies it
and for every thread and process that this one starts; so it is applied before there are others.
From ABI 6 on (Linux 6.12) it also refuses signals to processes outside and their abstract sockets.
Files that were open before stay open.

See <https://docs.kernel.org/userspace-api/landlock.html> and `<linux/landlock.h>`.
"""

import ctypes
import errno
import os
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from plateau.farm.process.lifecycle import c_call
from plateau.worker.confinement.capabilities import refuse_new_privileges

#: The same numbers on every architecture.
_CREATE_RULESET: Final = 444
_ADD_RULE: Final = 445
_RESTRICT_SELF: Final = 446
_WANTS_VERSION: Final = 1
_PATH_BENEATH: Final = 1

# LANDLOCK_ACCESS_FS_…
_EXECUTE: Final = 1 << 0
_WRITE_FILE: Final = 1 << 1
_READ_FILE: Final = 1 << 2
_READ_DIR: Final = 1 << 3
_REMOVE_FILE: Final = 1 << 5
_MAKE_REG: Final = 1 << 8
_TRUNCATE: Final = 1 << 14
_IOCTL_DEV: Final = 1 << 15
#: What a rule on a file may name.
_OF_FILES: Final = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE | _IOCTL_DEV

#: How many rights each ABI knows, from 1 on; later ones have those of the fifth.
_RIGHTS: Final = (13, 14, 15, 15, 16)
_SCOPES_FROM_ABI: Final = 6
_ABSTRACT_SOCKETS_AND_SIGNALS: Final = 0b11

#: The right to open a file whose name is known.
OPEN: Final = _READ_FILE
#: The right to open files and to list folders.
READ: Final = _READ_FILE | _READ_DIR
#: The right to run programs, too. The loader of a program's libraries needs it as well.
RUN: Final = READ | _EXECUTE
#: The right to make, change, rename and remove files, but no folders.
KEEP_FILES: Final = READ | _WRITE_FILE | _REMOVE_FILE | _MAKE_REG | _TRUNCATE
#: The right to read and change files that are there.
CHANGE: Final = READ | _WRITE_FILE | _TRUNCATE
#: The right to open a device and to send it commands.
USE_DEVICE: Final = _READ_FILE | _WRITE_FILE | _IOCTL_DEV


def abi() -> int:
    """Return the version of Landlock that this kernel has; 0 if it has none."""
    if not sys.platform.startswith("linux"):
        return 0
    with suppress(OSError):
        return _syscall(_CREATE_RULESET, None, 0, _WANTS_VERSION)
    return 0


def restrict(allowed: Iterable[tuple[Path, int]]) -> None:
    """Refuse all files but those at and beneath these paths, in this thread and all that it starts.

    Parameters
    ----------
    allowed : iterable of (Path, int)
        Paths and rights: `OPEN`, `READ`, `RUN`, `KEEP_FILES`, `CHANGE` or `USE_DEVICE`. Missing
        paths are left out.

    Raises
    ------
    OSError
        The kernel refuses the ruleset; all files stay open to this thread.
    """
    version = abi()
    if not version:
        raise OSError(errno.ENOSYS, "this kernel has no Landlock")
    handled = (1 << _RIGHTS[min(version, len(_RIGHTS)) - 1]) - 1
    # struct landlock_ruleset_attr: u64 handled_access_fs, handled_access_net, scoped
    attributes = struct.pack("=QQQ", handled, 0, _ABSTRACT_SOCKETS_AND_SIGNALS)
    known = len(attributes) if version >= _SCOPES_FROM_ABI else 8
    ruleset = _syscall(_CREATE_RULESET, attributes[:known], known, 0)
    try:
        for path, rights in allowed:
            with suppress(FileNotFoundError, NotADirectoryError, PermissionError):
                _allow(ruleset, path, rights & handled)
        refuse_new_privileges()
        _syscall(_RESTRICT_SELF, ruleset, 0)
    finally:
        os.close(ruleset)


def _allow(ruleset: int, path: Path, rights: int) -> None:
    there = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        if not path.is_dir():
            rights &= _OF_FILES
        # struct landlock_path_beneath_attr, packed: u64 allowed_access; s32 parent_fd
        rule = struct.pack("=Qi", rights, there)
        _syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0)
    finally:
        os.close(there)


def _syscall(number: int, *arguments: int | bytes | None) -> int:
    given = (ctypes.c_long(one) if isinstance(one, int) else one for one in arguments)
    return c_call("syscall", ctypes.c_long(number), *given, what="Landlock")
