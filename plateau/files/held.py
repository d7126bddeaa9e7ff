"""Holds a folder or a file while it is written: whoever else would write there is refused.

The holder is in a hidden file beside what it holds, which the kernel locks for it, so a dead one
keeps nobody out. Where no lock is to be had (in a folder of somebody else, or without a file system
that has locks) nothing is held.
"""

import fcntl
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed

_LOCK: Final = ".plateau-lock"


class Held(CommandFailed):
    """Another process, or another thread, writes there; the message says which and since when."""


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold a folder, or a file that need not be there; raises `Held` where another does."""
    file = path / _LOCK if path.is_dir() else path.with_name(f".{path.name}{_LOCK}")
    lock = _lock(path, file, os.O_CREAT)
    if lock is None:
        yield
        return
    try:
        holder = {
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "since": datetime.now().astimezone().isoformat(),
        }
        with suppress(OSError):  # it is not ours, or the disk is full
            os.truncate(lock, 0)
            os.pwrite(lock, json.dumps(holder).encode(), 0)
        yield
    finally:
        with suppress(OSError):
            file.unlink()
        os.close(lock)


def refuse_held(folder: Path) -> None:
    """Raise `Held` where somebody else holds the folder now."""
    lock = _lock(folder, folder / _LOCK, 0)
    if lock is not None:
        os.close(lock)


def _lock(path: Path, file: Path, flags: int) -> int | None:
    """The descriptor of the locked file; None where there is no lock to be had."""
    while True:
        try:
            try:
                lock = os.open(file, os.O_RDWR | os.O_NOFOLLOW | flags, 0o666)
            except PermissionError:  # of another user
                lock = os.open(file, os.O_RDONLY | os.O_NOFOLLOW)
        except OSError:
            return None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(lock), file.stat()):
                return lock
        except BlockingIOError:
            with os.fdopen(lock, encoding="utf-8") as held_by:
                raise Held(
                    f"{path} is being written by {_holder(held_by.read())}: wait until that has "
                    "ended, or give another one with -o"
                ) from None
        except FileNotFoundError:  # its holder has just removed it
            pass
        except OSError:
            os.close(lock)
            return None
        os.close(lock)


def _holder(text: str) -> str:
    """What the file says of its holder, which may be about to write it."""
    try:
        by = json.loads(text)
        since = datetime.fromisoformat(by["since"])
        where = "" if by["host"] == socket.gethostname() else f" on {by['host']}"
        return f"process {int(by['pid'])}{where} since {since:%Y-%m-%d %H:%M:%S}"
    except (ValueError, KeyError, TypeError):
        return "another process"
