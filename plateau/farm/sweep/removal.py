"""A sweep's removals from the blob store, counted."""

from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from plateau.farm.blobs.store import Blobs, StoredBlob

#: Longer than any put takes.
_LEFT_S: Final = 86_400.0


class Removal:
    """Removes blobs and counts them; in a dry run only counts them."""

    def __init__(self, store: Blobs, *, dry_run: bool) -> None:
        self.store = store
        self.dry_run = dry_run
        self.blobs = self.freed_bytes = 0  #: so far

    def remove(self, found: Iterable[StoredBlob]) -> int:
        """Remove these blobs; returns how many they were."""
        before = self.blobs
        for blob in found:
            if not self.dry_run:
                self.store.delete(blob.name)
            self._count(blob.size)
        return self.blobs - before

    def remove_half_put(self) -> int:
        """Remove the files of killed puts; returns how many they were."""
        before = self.blobs
        for path in self.store.leftovers(_LEFT_S):
            with suppress(FileNotFoundError):  # another sweep was first
                size = path.stat().st_size
                if not self.dry_run:
                    path.unlink()
                self._count(size)
        return self.blobs - before

    def _count(self, size: int) -> None:
        self.blobs += 1
        self.freed_bytes += size
