"""Files and folders that are safe from a power loss.

A written file, even one renamed into place, is only in memory until it is synced; so is its name
until its folder is synced.
"""

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

#: Two changes within a tick of a file system's clock look like one.
_TICK_S: Final = 2.0
_MOST_KNOWN: Final = 1000


def sync(path: Path) -> None:
    """Return once the file's bytes, or the folder's entries, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_tree(root: Path) -> None:
    """Sync the folder and every file and folder in it."""
    for path in root.rglob("*"):
        sync(path)
    sync(root)


def make_folder(folder: Path) -> None:
    """Make the folder and the missing ones above it, safe from a power loss; it may exist."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync(folder.parent)


class FolderSync:
    """Syncs the folders below a root that have changed since their last sync, by any process.

    A sync costs the disk a flush, even with nothing to write.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._known: dict[Path, tuple[int, int]] = {}  # inode and mtime at the last sync

    def up_from(self, folder: Path) -> None:
        """Sync the folder and each one above it, up to the root.

        One that another process has removed meanwhile holds nothing that could be lost.
        """
        while folder != self._root:
            with suppress(FileNotFoundError):
                self._sync(folder)
            folder = folder.parent
        self._sync(folder)

    def _sync(self, folder: Path) -> None:
        status = folder.stat()
        now = (status.st_ino, status.st_mtime_ns)
        if self._known.get(folder) == now:
            return
        has_settled = time.time() - status.st_mtime > _TICK_S
        sync(folder)
        if has_settled:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[folder] = now
