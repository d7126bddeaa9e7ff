"""Stored files, verified before the first byte is served.

Each process reads a blob once and compares it with the SHA-256 that was noted when it was written.
A damaged blob is not served.
"""

import hashlib
import logging
from functools import lru_cache
from typing import Final

from plateau.farm.blobs.store import Blobs

_LOG = logging.getLogger(__name__)

#: Blobs that a process remembers as whole; they take 3 MB.
_REMEMBERED: Final = 10_000


class SpoiledBlob(Exception):
    """A stored blob is not what was written."""

    def __init__(self, name: str) -> None:
        super().__init__(f"{name} is damaged")
        self.name = name
        _LOG.error("%s", self)


class StoredFiles:
    """The files of jobs, verified."""

    def __init__(self, store: Blobs) -> None:
        self._blobs = store
        #: Make sure that the blob of this name has this SHA-256; raises as `content`.
        self.require = lru_cache(_REMEMBERED)(self._require)

    def content(self, name: str, sha256: str | None) -> bytes:
        """The blob's bytes, which have this SHA-256; it is None of a lost blob.

        Raises
        ------
        SpoiledBlob
            Its bytes are others.
        FileNotFoundError
            It is lost.
        """
        if sha256 is None:
            raise FileNotFoundError(name)
        content = self._blobs.get(name)
        if hashlib.sha256(content).hexdigest() != sha256:
            raise SpoiledBlob(name)
        return content

    def _require(self, name: str, sha256: str | None) -> None:
        if sha256 is None:
            raise FileNotFoundError(name)
        found = hashlib.sha256()
        for chunk in self._blobs.chunks(name):
            found.update(chunk)
        if found.hexdigest() != sha256:
            raise SpoiledBlob(name)
