"""A network mount that stops: whoever looks into its folder waits until the context ends.

It is a FUSE mount whose other end answers the kernel's greeting, and nothing after that. A wait for
it is one that signals can end, in which it is unlike a frozen disk (`LoopDisk.frozen`).
"""

import contextlib
import os
import struct
import threading
from pathlib import Path
from typing import Final

import pytest

from plateau.farm.process.lifecycle import c_call
from tests.support.missing import missing

_DEVICE: Final = Path("/dev/fuse")
_FOLDER_MODE: Final = 0o40000
_BIND: Final = 4096  # MS_BIND
_DETACH: Final = 2  # MNT_DETACH
_REQUEST: Final = struct.Struct("IIQQIIII")  # length, operation, unique number, …
_GREETING: Final = struct.Struct("IiQ IIII HHIIHHI 28x")  # an answer's header, and its content
_LARGEST: Final = 1 << 17
_VERSION: Final = (7, 31)


class BoundFolder:
    """A folder that is seen under another path too, while the context lasts."""

    def __init__(self, folder: Path, seen: Path) -> None:
        _needs_root()
        self._folder, self._seen = folder, seen

    def __enter__(self) -> Path:
        self._seen.mkdir()
        folder, seen = os.fsencode(self._folder), os.fsencode(self._seen)
        c_call("mount", folder, seen, None, _BIND, None, what="mount")
        return self._seen

    def __exit__(self, *error: object) -> None:
        _unmount(self._seen)


class SilentMount:
    """A mount over a folder that answers nothing, while the context lasts.

    Who waits for it then gets an error, and the folder is what it was before. Without root or FUSE
    the test skips.
    """

    def __init__(self, folder: Path) -> None:
        _needs_root()
        if not _DEVICE.exists():
            missing("a mount of our own needs FUSE (modprobe fuse)")
        self._folder = folder

    def __enter__(self) -> "SilentMount":
        self._device = os.open(_DEVICE, os.O_RDWR | os.O_CLOEXEC)
        options = f"fd={self._device},rootmode={_FOLDER_MODE:o},user_id=0,group_id=0,allow_other"
        where = os.fsencode(self._folder)
        c_call("mount", b"silent", where, b"fuse", 0, options.encode(), what="mount")
        threading.Thread(target=self._greet, daemon=True).start()
        return self

    def _greet(self) -> None:
        with contextlib.suppress(OSError):
            request = os.read(self._device, _LARGEST)
            _, _, number, *_ = _REQUEST.unpack_from(request)
            size = _GREETING.size
            content = (*_VERSION, 0, 0, 16, 12, 4096, 1, 1, 0, 0)
            os.write(self._device, _GREETING.pack(size, 0, number, *content))

    def __exit__(self, *error: object) -> None:
        _unmount(self._folder)
        os.close(self._device)


def _needs_root() -> None:
    """Skip the test where nobody may mount."""
    if os.geteuid() != 0:
        pytest.skip("a mount needs root")


def _unmount(folder: Path) -> None:
    c_call("umount2", os.fsencode(folder), _DETACH, what="umount")
