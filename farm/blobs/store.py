"""The blob store: scenes, partials, checkpoints and results, in a folder or in S3."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple
from urllib.parse import urlsplit
from urllib.request import url2pathname

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError

from plateau.farm.blobs.bucket import Bucket
from plateau.farm.blobs.errors import is_absence, why
from plateau.farm.blobs.folder import INCOMING, Folder
from plateau.farm.model.errors import BlobsUnavailable

#: The store's own blob: to which Redis it belongs.
MARK: Final = "plateau-store"

#: What the names of all scenes begin with, and of all that belongs to jobs.
SCENES: Final = "scenes/"
JOBS: Final = "jobs/"
_PARTIAL: Final = re.compile(rf"{JOBS}[0-9a-f]{{12}}/partials/[^/]+\.exr")


def scene(sha256: str) -> str:
    """Where an uploaded scene is kept, as it came."""
    return f"{SCENES}{sha256}"


def of_job(job_id: str) -> str:
    """What the names of all blobs of a job begin with."""
    return f"{JOBS}{job_id}/"


def in_job(name: str) -> tuple[str, str]:
    """The id of the job whose blob it is, and its name without what `of_job` gives."""
    job_id, _, rest = name.removeprefix(JOBS).partition("/")
    return job_id, rest


def partial(job_id: str, index: int, attempt: str) -> str:
    """Where one attempt at a slice is kept; the ledger says which attempt counts."""
    return f"{partials(job_id)}{index:06d}-{attempt}.exr"


def glimpse(job_id: str, attempt: str) -> str:
    """Where the first pass of a job's first slice is kept until it is shown."""
    return f"{partials(job_id)}glimpse-{attempt}.exr"


def is_partial(name: str) -> bool:
    """Whether it is a name as `partial` and `glimpse` give it, of whatever job.

    Names in a ledger are what a worker has said: nothing else is read, shown or removed by them.
    """
    return _PARTIAL.fullmatch(name) is not None


def partials(job_id: str) -> str:
    """What the names of all partials of a job begin with."""
    return f"{of_job(job_id)}partials/"


def checkpoints(job_id: str) -> str:
    """What the names of all checkpoints of a job begin with."""
    return f"{of_job(job_id)}checkpoints/"


def results(job_id: str) -> str:
    """What the names of all results of a job begin with; `Jobs.results` says which count.

    A set of them is a folder with ``image.exr``, ``image.png``, ``thumbnail.png`` and, where there
    is something to show, ``difference.png`` and ``non-finite.png``.
    """
    return f"{of_job(job_id)}results/"


#: At the end of the names of sets that no other follows: their EXR is compressed.
FINAL: Final = "-final"


def result_set(job_id: str, spp: int, token: str) -> str:
    """Where the set of results lies that the monitor with this fencing token makes at `spp`."""
    return f"{results(job_id)}{spp:07d}-{token}"


def spp_of_set(name: str) -> int | None:
    """The spp in the name that `result_set` gave; None of another name."""
    spp, dash, _ = name.rpartition("/")[2].partition("-")
    return int(spp) if dash else None


def previews(job_id: str) -> str:
    """What the names of all pictures that a job keeps of its way begin with."""
    return f"{of_job(job_id)}previews/"


def preview(job_id: str, spp: int) -> str:
    """Where the picture of the merged image at `spp` samples per pixel is kept."""
    return f"{previews(job_id)}{spp:07d}.png"


def spp_of_preview(name: str) -> int:
    """The spp in the name that `preview` gave."""
    return int(name.rpartition("/")[2].removesuffix(".png"))


class StoredBlob(NamedTuple):
    """A blob in a listing."""

    name: str
    size: int  #: in bytes


class Blobs:
    """A folder, or a bucket in S3 with a prefix: ``s3://BUCKET/PREFIX``.

    Whatever failed may be asked for again: a put replaces what is there by the same content, and
    where that matters the answer is looked for in the store rather than taken from an error, which
    does not say whether it was done.

    Raises
    ------
    ValueError
        By the constructor: `where` cannot be a store.
    FileNotFoundError
        By the methods that read: there is no such blob.
    BlobsUnavailable
        By all: the store cannot be reached, is full or refuses.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        folder = _folder(where)
        self._place: Bucket | Folder = Bucket(where) if folder is None else Folder(folder)
        self._marked = self.in_folder and self._place.has(MARK)

    @property
    def in_folder(self) -> bool:
        """Whether the blobs are files."""
        return isinstance(self._place, Folder)

    def mark(self) -> str | None:
        """What the store is marked with; None where it has no mark.."""
        with suppress(FileNotFoundError):
            return self.get(MARK).decode(errors="replace")
        return None

    def make_mark(self, content: str) -> str:
        """Mark the store, once and for all; returns what it is marked with now."""
        self.create(MARK, content.encode())
        return self.get(MARK).decode(errors="replace")

    def create(self, name: str, content: bytes) -> bool:
        """Store a small blob unless there is one of its name; returns whether it has this content.

        Of many callers with contents of their own at most one is told that it has. Where a try
        failed it may have been done all the same, so it is looked what is there.
        """
        try:
            with _store_errors(AlreadyExistsError):
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

        A put that fails leaves nothing behind, one that is killed may leave one of `leftovers`.
        """
        with _store_errors():
            self._check_mark()
            self._place.put(name, content)

    def put_once(self, name: str, content: BinaryIO, size: int) -> None:
        """Store a blob whose name fixes its content, unless it is there already in its full size.

        One of another size was torn by what happened to the store, and is put again.
        """
        if self.size(name) == size:
            with _store_errors():  # whoever put it may not have come to that yet
                self._place.settle(name)
            return
        try:
            self.put(name, content)
        except BlobsUnavailable:
            if self.size(name) != size:  # else but the answer was lost
                raise

    def get(self, name: str) -> bytes:
        """The blob's bytes."""
        with self._reading(name):
            return bytes(self._place.open(name).bytes())

    def chunks(self, name: str) -> Iterator[bytes]:
        """The blob's bytes, a few MB at a time."""
        with self._reading(name):
            for chunk in self._place.open(name).stream(min_chunk_size=1 << 22):
                yield bytes(chunk)

    def size(self, name: str) -> int | None:
        """The blob's number of bytes; None where there is no such blob."""
        try:
            with self._reading(name):
                return self._place.size(name)
        except FileNotFoundError:
            return None

    def exists(self, name: str) -> bool:
        """Whether there is such a blob."""
        return self.size(name) is not None

    def names(self, prefix: str) -> list[str]:
        """The names that begin with `prefix`, which ends in a slash or is empty: all names."""
        return [blob.name for blob in self.listing(prefix)]

    def listing(self, prefix: str) -> Iterator[StoredBlob]:
        """As `names`, with sizes, and read a page at a time: the blobs may be many."""
        with _store_errors():
            self._check_mark()
            for page in obstore.list(self._place.store, prefix):
                for meta in page:
                    if not meta["path"].startswith((INCOMING, MARK)):
                        yield StoredBlob(meta["path"], meta["size"])

    def delete(self, *names: str) -> None:
        """Remove blobs; one that is not there is fine."""
        with _store_errors():
            self._place.delete(names)

    def leftovers(self, older_than_s: float) -> list[Path]:
        """The files that puts which were killed left in a folder, for the caller to remove.

        Parameters
        ----------
        older_than_s
            Longer than any put takes, so that none of those under way is among them.
        """
        return self._place.leftovers(older_than_s)

    @contextmanager
    def _reading(self, name: str) -> Iterator[None]:
        """Let a missing blob be missing only where the store itself is there."""
        if not self._marked:
            self._check_mark()  # so that we know a place that is not the store when we see it
        try:
            with _store_errors(FileNotFoundError):
                yield
        except FileNotFoundError as error:
            if not is_absence(error):
                raise _failed(error) from error
            self._check_mark()
            raise FileNotFoundError(f"the blob store has no {name}") from error

    def _check_mark(self) -> None:
        """A place that has lost its mark is not the store.

        It is the folder where a disk was mounted, or a gateway that has lost what is behind it.
        """
        with _store_errors():
            there = self._place.has(MARK)
        if self._marked and not there:
            raise BlobsUnavailable(self._place.lost.format(where=self.where))
        self._marked = there


def _folder(where: str) -> Path | None:
    """The folder that a path or a ``file://`` URL means; None for any other URL."""
    if "://" not in where:
        return Path(where).absolute()
    url = urlsplit(where)
    return Path(url2pathname(url.path)) if url.scheme == "file" else None


@contextmanager
def _store_errors(*but: type[Exception]) -> Iterator[None]:
    """Raise `BlobsUnavailable` for whatever the store raises, but for the types that are named."""
    try:
        yield
    except but:
        raise
    except (BaseError, OSError) as error:
        raise _failed(error) from error


def _failed(error: Exception) -> BlobsUnavailable:
    return BlobsUnavailable(f"the blob store failed: {why(error)}")
