"""The data folder: embedded Redis, local blobs and logs. One process tree uses it at a time."""

import contextlib
import fcntl
import json
import os
import time
from pathlib import Path
from typing import Final, TextIO

from plateau.errors import PlateauError
from plateau.files.out_folder import make

#: Processes of a tree that was killed need a moment to notice that and to end.
_LEAVING_S: Final = 10.0


class InUse(PlateauError):
    """Another process tree uses the data folder; the message names its process and its URL."""


class DataFolder:
    """A folder that is locked while the context lasts; to enter it may raise `InUse`.

    A process that inherits `lock_fd` holds the lock too.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.redis = path / "redis"
        self.blobs = path / "blobs"
        self.logs = path / "logs"
        self._lock: TextIO | None = None

    @property
    def lock_fd(self) -> int:
        """The lock's file descriptor."""
        assert self._lock is not None, "the data folder is not locked"
        return self._lock.fileno()

    def __enter__(self) -> "DataFolder":
        make(self.path, "PLATEAU_DATA", mode=0o700)
        self.logs.mkdir(exist_ok=True)
        # Not truncated: the file names the holder of the lock.
        lock = os.fdopen(
            os.open(self.path / "lock", os.O_RDWR | os.O_CREAT, 0o600), "r+", encoding="utf-8"
        )
        try:
            _acquire(lock, self.path)
        except BaseException:
            lock.close()
            raise
        self._lock = lock
        self.note_url("")
        return self

    def __exit__(self, *error: object) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def note_url(self, url: str) -> None:
        """Write our process id and the service's URL into the lock file, for `InUse`."""
        assert self._lock is not None, "the data folder is not locked"
        self._lock.seek(0)
        self._lock.truncate()
        json.dump({"pid": os.getpid(), "url": url}, self._lock)
        self._lock.flush()


def is_in_use(path: Path) -> bool:
    """Whether a process tree holds the folder; a folder without a lock file counts as in use."""
    try:
        # Another user's may be anything: a pipe, which would wait for a writer, or a link.
        lock = os.open(path / "lock", os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError:
        return True
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


def _acquire(lock: TextIO, path: Path) -> None:
    deadline = time.monotonic() + _LEAVING_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pid, url = _holder(lock)
            if _runs(pid) or time.monotonic() > deadline:
                where = f" at {url}" if url else ""
                raise InUse(
                    f"{path} is in use: Plateau already runs there{where} (process {pid}); "
                    "stop that one, or set PLATEAU_DATA to another folder"
                ) from None
            time.sleep(0.1)
        else:
            return


def _holder(lock: TextIO) -> tuple[int, str]:
    lock.seek(0)
    with contextlib.suppress(ValueError, KeyError, TypeError):
        noted = json.loads(lock.read())
        return int(noted["pid"]), str(noted["url"])
    return 0, ""


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return pid > 0
