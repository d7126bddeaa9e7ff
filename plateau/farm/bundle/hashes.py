"""The SHA-256 of files, remembered on this machine for as long as a file does not change."""

import hashlib
import os
import sqlite3
import stat
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

_CHUNK_BYTES: Final = 1 << 20
#: A file that changed this short before it was read may change again with the same times.
_SETTLED_NS: Final = 2 * 10**9
_WAIT_S: Final = 30.0  #: for other processes that write to the table

_TABLE: Final = "CREATE TABLE IF NOT EXISTS hashes (path TEXT PRIMARY KEY, state TEXT, sha256 TEXT)"


class FileChanges(OSError):
    """A file changed while it was read."""


@dataclass(frozen=True)
class Content:
    """What a file holds."""

    bytes: int
    sha256: str


class FileHashes:
    """A table of hashes in a file, which processes of one machine may share.

    An entry holds while the file has the same device, inode, size and times, the time of the last
    change of its inode included, which no program sets.
    """

    def __init__(self, table: Path) -> None:
        self._table = table

    def content(self, path: Path) -> Content:
        """The size and SHA-256 of a plain file, which is read only where it is new or has changed.

        Raises
        ------
        FileChanges
            It changed while it was read.
        OSError
            It cannot be read, or is not a plain file; or the table cannot be used.
        """
        try:
            return self._content(path)
        except sqlite3.Error as error:
            raise OSError(f"{self._table}: {error}") from error

    def _content(self, path: Path) -> Content:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb", buffering=0) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise OSError(f"{path} is not a plain file")
            state = _state(status)
            known = self._known(path, state)
            if known is not None:
                return Content(status.st_size, known)
            read_at = time.time_ns()
            sha256 = sha256_of(file)
            if _state(os.fstat(file.fileno())) != state:
                raise FileChanges(f"{path} changed while it was read")
        if read_at - max(status.st_mtime_ns, status.st_ctime_ns) > _SETTLED_NS:
            self._remember(path, state, sha256)
        return Content(status.st_size, sha256)

    def _known(self, path: Path, state: str) -> str | None:
        with self._opened() as table:
            found = table.execute(
                "SELECT sha256 FROM hashes WHERE path = ? AND state = ?", (str(path), state)
            ).fetchone()
        return None if found is None else str(found[0])

    def _remember(self, path: Path, state: str, sha256: str) -> None:
        row = (str(path), state, sha256)
        with self._opened() as table, table:
            table.execute("INSERT OR REPLACE INTO hashes VALUES (?, ?, ?)", row)

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        self._table.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(self._table, timeout=_WAIT_S)) as table:
            table.execute(_TABLE)
            yield table


def sha256_of(file: IO[bytes]) -> str:
    """Return the SHA-256 of a file from where it is read on, a part at a time."""
    digest = hashlib.sha256()
    while chunk := file.read(_CHUNK_BYTES):
        digest.update(chunk)
    return digest.hexdigest()


def _state(status: os.stat_result) -> str:
    """All by which a change of the file shows."""
    seen = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
    return " ".join(map(str, seen))
