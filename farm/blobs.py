"""The blob store: scenes, partials, checkpoints and results, in a folder or in S3."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import obstore
from obstore.exceptions import BaseError
from obstore.store import LocalStore, from_url

from farm.errors import StoreUnavailable


def scene(sha256: str) -> str:
    """Where an uploaded scene is kept, as it came."""
    return f"scenes/{sha256}"


def partial(job_id: str, index: int, attempt: str) -> str:
    """Where one attempt at a slice is kept; the ledger says which attempt counts."""
    return f"{partials(job_id)}{index:06d}-{attempt}.exr"


def partials(job_id: str) -> str:
    """What the names of all partials of a job begin with."""
    return f"jobs/{job_id}/partials/"


def checkpoints(job_id: str) -> str:
    """What the names of all checkpoints of a job begin with."""
    return f"jobs/{job_id}/checkpoints/"


def result(job_id: str, name: str) -> str:
    """Where a result (``image.exr``, ``image.png``, ``difference.png``) is kept."""
    return f"jobs/{job_id}/{name}"


class Blobs:
    """A folder, or any store that obstore opens by URL.

    Raises
    ------
    FileNotFoundError
        By the methods that read: there is no such blob.
    StoreUnavailable
        By all: the store cannot be reached, is full or refuses.
    """

    def __init__(self, where: str) -> None:
        if "://" in where:
            self._store = from_url(where)
        else:
            self._store = LocalStore(Path(where).absolute(), mkdir=True, automatic_cleanup=True)
        self.where = where

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all."""
        with _store_errors():
            obstore.put(self._store, name, content)

    def get(self, name: str) -> bytes:
        """The blob's bytes."""
        with _store_errors():
            return bytes(obstore.get(self._store, name).bytes())

    def chunks(self, name: str) -> Iterator[bytes]:
        """The blob's bytes, a few MB at a time."""
        with _store_errors():
            for chunk in obstore.get(self._store, name).stream(min_chunk_size=1 << 22):
                yield bytes(chunk)

    def exists(self, name: str) -> bool:
        """Whether there is such a blob."""
        try:
            with _store_errors():
                obstore.head(self._store, name)
        except FileNotFoundError:
            return False
        return True

    def names(self, prefix: str) -> list[str]:
        """The names that begin with `prefix`, which ends in a slash."""
        with _store_errors():
            return [meta["path"] for batch in obstore.list(self._store, prefix) for meta in batch]

    def delete(self, *names: str) -> None:
        """Remove blobs; one that is not there is fine."""
        for name in names:
            try:
                with _store_errors():
                    obstore.delete(self._store, name)
            except FileNotFoundError:
                continue


@contextmanager
def _store_errors() -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise
    except (BaseError, OSError) as error:
        # obstore appends its whole chain of causes, a line each.
        raise StoreUnavailable(f"the blob store failed: {str(error).splitlines()[0]}") from error
