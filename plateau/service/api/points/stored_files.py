"""Stored files, verified before the first byte is served.

Each process reads a blob once and compares it with the SHA-256 that was noted when it was written.
A damaged blob is made again if possible; otherwise it is not served.
"""

import hashlib
import logging
import threading
from collections import OrderedDict
from typing import Final

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs

_LOG = logging.getLogger(__name__)

#: Blobs that a process remembers as whole, or as lost for good; they take 3 MB.
_REMEMBERED: Final = 10_000


class SpoiledBlob(Exception):
    """A stored blob is not what was written, and cannot be made again."""

    def __init__(self, name: str) -> None:
        super().__init__(f"{name} is damaged or lost, and cannot be made again")
        self.name = name


class StoredFiles:
    """The files of jobs, verified."""

    def __init__(self, store: Blobs, jobs: Jobs) -> None:
        self._blobs = store
        self._jobs = jobs
        self._lock = threading.Lock()
        self._whole = _Remembered()
        self._lost = _Remembered()

    def require(self, name: str, sha256: str) -> None:
        """Make sure that the blob has this SHA-256; a damaged or lost one is made again.

        If that is impossible, a damaged one raises `SpoiledBlob` and a lost one
        `FileNotFoundError`.
        """
        if (name, sha256) in self._whole:
            return
        found = self._sha256(name)
        if found != sha256 and not self._remade(name, sha256, spoiled=found is not None):
            raise FileNotFoundError(name) if found is None else SpoiledBlob(name)
        self._whole.add((name, sha256))

    def content(self, name: str, sha256: str | None) -> bytes:
        """The blob's bytes, or an error as by `require`; without a SHA-256 they are not checked."""
        content = self._blobs.get(name)
        if sha256 is None or hashlib.sha256(content).hexdigest() == sha256:
            return content
        self._whole.discard((name, sha256))
        self.require(name, sha256)
        return self._blobs.get(name)

    def _sha256(self, name: str) -> str | None:
        """The digest of the stored bytes; None without a blob of this name."""
        found = hashlib.sha256()
        try:
            for chunk in self._blobs.chunks(name):
                found.update(chunk)
        except FileNotFoundError:
            return None
        return found.hexdigest()

    def _remade(self, name: str, sha256: str, *, spoiled: bool) -> bool:
        """Make the blob again, one at a time, and try it once; returns whether it is whole."""
        # Imported at the first use: numpy and the metric take a fifth of the API's start.
        from plateau.service.api.points.remaking import remade

        with self._lock:
            if (name, sha256) in self._lost:
                return False
            if self._sha256(name) == sha256:  # another request was first
                return True
            content = remade(name, sha256, self._jobs, self._blobs)
            if content is None:
                if spoiled:  # a lost one may only be an older set of results
                    _LOG.error("%s", SpoiledBlob(name))
                self._lost.add((name, sha256))
                return False
            self._blobs.put(name, content)
        _LOG.warning("%s was damaged, and was made again from what is kept of its job", name)
        return True


class _Remembered:
    """A bounded set of blobs, by name and SHA-256; for any thread."""

    def __init__(self) -> None:
        self._blobs: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._lock = threading.Lock()

    def __contains__(self, blob: tuple[str, str]) -> bool:
        with self._lock:
            return blob in self._blobs

    def add(self, blob: tuple[str, str]) -> None:
        with self._lock:
            self._blobs[blob] = None
            while len(self._blobs) > _REMEMBERED:
                self._blobs.popitem(last=False)

    def discard(self, blob: tuple[str, str]) -> None:
        with self._lock:
            self._blobs.pop(blob, None)
