"""`Blobs`: the store, a folder or a bucket."""

import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar
from urllib.parse import urlsplit
from urllib.request import url2pathname

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError

from plateau.farm.blobs.bucket import Bucket, Served
from plateau.farm.blobs.errors import is_absence, why
from plateau.farm.blobs.folder import INCOMING, Folder
from plateau.farm.blobs.names import MARK
from plateau.farm.model.errors import BlobsUnavailable
from plateau.farm.model.scene_roots import at_home

_Value = TypeVar("_Value")


class StoredBlob(NamedTuple):
    """A blob in a listing."""

    name: str
    size: int  #: in bytes


class Blobs:
    """A folder, or a bucket in S3 with a prefix: ``s3://BUCKET/PREFIX``.

    A node of a batch system has ``http://SECRET@HOST:PORT``, what a run's own process serves.

    Every call may be repeated after an error. An error does not say whether the store did the work:
    where that matters, the methods look into the store.

    Raises
    ------
    ValueError
        By the constructor: `where` cannot be a store.
    FileNotFoundError
        By the methods that read: the store has no such blob.
    BlobsUnavailable
        By all: the store cannot be reached, is full or refuses.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self._place: Bucket | Folder = _place(where)
        self._calls: dict[int, float] = {}  # the threads that wait for the store, since when
        self._marked = isinstance(self._place, Folder) and self._place.has(MARK)

    @property
    def scratch(self) -> Path | None:
        """The folder for half-written blobs; None where the blobs are no files."""
        return self._place.scratch

    def called_since(self, thread: int) -> float | None:
        """Return since when a thread waits for the store, by `monotonic`; None if it does not."""
        return self._calls.get(thread)

    def mark(self) -> str | None:
        """The content of the store's mark; None where it has none."""
        with suppress(FileNotFoundError):
            return self.get(MARK).decode(errors="replace")
        return None

    def make_mark(self, content: str) -> str:
        """Mark the store unless it has a mark; returns the content of its mark now."""
        self.create(MARK, content.encode())
        return self.get(MARK).decode(errors="replace")

    def create(self, name: str, content: bytes) -> bool:
        """Store a small blob unless its name is taken; returns whether the blob has this content.

        At most one of many callers with different contents gets True. A failed try may have
        stored its blob all the same, so the store is asked for what it has.
        """
        try:
            with self._calling(AlreadyExistsError):
                self._place.create(name, content)
        except AlreadyExistsError:
            return self.get(name) == content
        except BlobsUnavailable:
            with suppress(FileNotFoundError):
                return self.get(name) == content
            raise
        return True

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all; on returning it is safe from a power loss.

        A failed put leaves nothing behind; a killed one may leave one of `leftovers`.
        """
        with self._calling():
            self._check_mark()
            self._place.put(name, content)
            if self.scratch is not None:  # it may be in the empty folder below a disk that has gone
                self._check_mark()

    def put_once(self, name: str, content: BinaryIO, size: int) -> None:
        """Store a blob whose name fixes its content, unless the store has it in its full size.

        A blob of another size is damaged, and is put again.
        """
        if self.size(name) == size:
            with self._calling():  # its put may not have got that far
                self._place.settle(name)
            return
        try:
            self.put(name, content)
        except BlobsUnavailable:
            if self.size(name) != size:  # otherwise only the answer was lost
                raise

    def get(self, name: str) -> bytes:
        """The blob's bytes."""
        with self._reading(name):
            return self._place.read(name)

    def result_of(self, read: "Future[_Value]") -> _Value:
        """What another thread reads by `get`, for which this one waits in its place."""
        with self._calling(FileNotFoundError):
            return read.result()

    def chunks(self, name: str) -> Iterator[bytes]:
        """The blob's bytes, a few MB at a time."""
        with self._reading(name):
            for chunk in self._place.open(name).stream(min_chunk_size=1 << 22):
                yield bytes(chunk)

    def size(self, name: str) -> int | None:
        """The blob's number of bytes; None where the store has no such blob."""
        try:
            with self._reading(name):
                return self._place.size(name)
        except FileNotFoundError:
            return None

    def exists(self, name: str) -> bool:
        """Whether the store has such a blob."""
        return self.size(name) is not None

    def names(self, prefix: str) -> list[str]:
        """The names that begin with `prefix`, which ends in a slash or is empty: all names."""
        return [blob.name for blob in self.listing(prefix)]

    def listing(self, prefix: str) -> Iterator[StoredBlob]:
        """As `names`, with sizes, read a page at a time."""
        with self._calling():
            self._check_mark()
            for page in obstore.list(self._place.store, prefix):
                for meta in page:
                    if not meta["path"].startswith((INCOMING, MARK)):
                        yield StoredBlob(meta["path"], meta["size"])

    def delete(self, *names: str) -> None:
        """Remove blobs; a missing blob is fine."""
        with self._calling():
            self._place.delete(names)

    def leftovers(self, older_than_s: float) -> list[Path]:
        """The files of killed puts in a folder, for the caller to remove.

        `older_than_s` must be longer than any put takes, so that running puts are not among them.
        """
        return self._place.leftovers(older_than_s)

    @contextmanager
    def _calling(self, *but: type[Exception]) -> Iterator[None]:
        """Note the wait, and raise `BlobsUnavailable` for every error but those of these types."""
        thread = threading.get_ident()
        outer = self._calls.get(thread)
        self._calls[thread] = time.monotonic()
        try:
            yield
        except but:
            raise
        except (BaseError, OSError) as error:
            raise _failed(error) from error
        finally:
            self._calls.pop(thread, None)
            if outer is not None:
                self._calls[thread] = time.monotonic()

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        """Raise `FileNotFoundError` only where the store itself is there."""
        if not self._marked:
            self._check_mark()  # later a place without the mark is known not to be the store
        try:
            with self._calling(FileNotFoundError):
                yield
        except FileNotFoundError as error:
            if not is_absence(error):
                raise _failed(error) from error
            self._check_mark()
            if self._is_there(name):  # now, and so the store was away before
                raise BlobsUnavailable(f"the blob store was away when {name} was sought") from error
            raise FileNotFoundError(f"the blob store has no {name}") from error

    def _is_there(self, name: str) -> bool:
        try:
            with self._calling(FileNotFoundError):
                self._place.size(name)
        except FileNotFoundError:
            return False
        return True

    def _check_mark(self) -> None:
        """Refuse a place that has lost its mark: an unmounted disk, a gateway without a server."""
        with self._calling():
            there = self._place.has(MARK)
        if self._marked and not there:
            raise BlobsUnavailable(self._place.lost.format(where=self.where))
        self._marked = there


def _place(where: str) -> Bucket | Folder:
    if "://" not in where:
        return Folder(at_home(where).absolute())
    url = urlsplit(where)
    if url.scheme == "file":
        return Folder(Path(url2pathname(url.path)))
    return Served(where) if url.scheme == "http" else Bucket(where)


def _failed(error: Exception) -> BlobsUnavailable:
    return BlobsUnavailable(f"the blob store failed: {why(error)}")
