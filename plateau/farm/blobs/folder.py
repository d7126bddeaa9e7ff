"""A blob store in a folder: a blob is on the disk before it has its name."""

import re
import secrets
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final

import obstore
from obstore.store import LocalStore

from plateau.farm.process.durable import FolderSync, make_folder, sync

#: A blob has a name below this until it is whole and on the disk.
INCOMING: Final = ".incoming/"

#: A name that is its file's path; obstore writes other characters, and a leading dot, otherwise.
_PLAIN: Final = re.compile(r"[\w-][\w.-]*(?:/[\w-][\w.-]*)*", re.ASCII)


class Folder:
    """The files below a folder, which is made where it is missing.

    Methods raise obstore's and the system's errors; `plateau.farm.blobs.store.Blobs` explains them.
    """

    #: The message where the store has lost its mark.
    lost = "the blob store is not in {where} any more: is it still mounted?"

    def __init__(self, path: Path) -> None:
        make_folder(path)
        self._path = path
        self.scratch = path / INCOMING
        self._folders = FolderSync(path)
        self.store = LocalStore(path, automatic_cleanup=True)

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all; on returning it is safe from a power loss."""
        incoming = INCOMING + secrets.token_hex(8)
        try:
            obstore.put(self.store, incoming, content)
            sync(self._path / incoming)
            obstore.rename(self.store, incoming, name)
        except BaseException:
            for left in (self._path / INCOMING).glob(f"{Path(incoming).name}*"):  # parts: a suffix
                left.unlink(missing_ok=True)
            raise
        self.settle(name)

    def create(self, name: str, content: bytes) -> None:
        """As `put`, but raise `AlreadyExistsError` where a blob has this name."""
        obstore.put(self.store, name, content, mode="create")
        sync(self._path / name)
        self.settle(name)

    def settle(self, name: str) -> None:
        """Return once a blob's name is safe from a power loss, whoever put it."""
        self._folders.up_from((self._path / name).parent)

    def read(self, name: str) -> bytes:
        """The blob's bytes, by this thread: obstore would pass them through two of its own."""
        if _PLAIN.fullmatch(name):
            return (self._path / name).read_bytes()
        return bytes(self.open(name).bytes())

    def open(self, name: str) -> "obstore.GetResult":
        """The blob, to be read."""
        return obstore.get(self.store, name)

    def size(self, name: str) -> int:
        """The blob's number of bytes."""
        return obstore.head(self.store, name)["size"]

    def has(self, name: str) -> bool:
        """Whether a blob has this name."""
        return (self._path / name).exists()

    def delete(self, names: Iterable[str]) -> None:
        """Remove blobs; a missing blob is fine."""
        for name in names:
            with suppress(FileNotFoundError):
                obstore.delete(self.store, name)

    def leftovers(self, older_than_s: float) -> list[Path]:
        """The files of puts that were killed longer ago than this."""
        left = []
        for path in (self._path / INCOMING).glob("*"):
            with suppress(FileNotFoundError):  # its put has just ended
                if path.stat().st_mtime < time.time() - older_than_s:
                    left.append(path)
        return left
