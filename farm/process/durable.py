"""What a power loss cannot take back: files and folders whose entries are on the disk.

A file that was written, even renamed into place, is in memory until it is synced; so is its name
until the folder that holds the name is.
"""

import os
import time
from pathlib import Path
from typing import Final

#: A change within the same tick of a file system's clock as the one before does not show.
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
    """Make the folder, and those above it that are missing, to stay; it may exist."""
    if folder.is_dir():
        return
    make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    sync(folder.parent)


class FolderSync:
    """Syncs the folders below a root, but not those that have not changed since they last were.

    Even one that has nothing to write costs the disk a flush. Changes by other processes count.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._known: dict[Path, tuple[int, int]] = {}  # as they were when they were last synced

    def up_from(self, folder: Path) -> None:
        """Sync the folder and each one above it, the root the last."""
        while folder != self._root:
            self._sync(folder)
            folder = folder.parent
        self._sync(folder)

    def _sync(self, folder: Path) -> None:
        status = folder.stat()
        now = (status.st_ino, status.st_mtime_ns)
        if self._known.get(folder) == now:
            return
        sync(folder)
        if time.time() - status.st_mtime > _TICK_S:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[folder] = now
