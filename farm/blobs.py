"""The blob store: scenes, partials, checkpoints and results, in a folder or in S3."""

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple
from urllib.parse import urlsplit
from urllib.request import url2pathname

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError
from obstore.store import LocalStore, from_url

from farm.durable import FolderSync, make_folder, sync
from farm.errors import BlobsUnavailable

#: In a folder, what is being put lies here until it is whole and on the disk.
_INCOMING: Final = ".incoming/"
#: The store's own blob: to which Redis it belongs.
MARK: Final = "plateau-store"


#: What the names of all scenes begin with, and of all that belongs to jobs.
SCENES: Final = "scenes/"
JOBS: Final = "jobs/"
STUDIES: Final = "studies/"


def scene(sha256: str) -> str:
    """Where an uploaded scene is kept, as it came."""
    return f"{SCENES}{sha256}"


def of_job(job_id: str) -> str:
    """What the names of all blobs of a job begin with."""
    return f"{JOBS}{job_id}/"


def partial(job_id: str, index: int, attempt: str) -> str:
    """Where one attempt at a slice is kept; the ledger says which attempt counts."""
    return f"{partials(job_id)}{index:06d}-{attempt}.exr"


def partials(job_id: str) -> str:
    """What the names of all partials of a job begin with."""
    return f"{of_job(job_id)}partials/"


def checkpoints(job_id: str) -> str:
    """What the names of all checkpoints of a job begin with."""
    return f"{of_job(job_id)}checkpoints/"


def results(job_id: str) -> str:
    """What the names of all results of a job begin with; `farm.jobs.Jobs.results` says which count.

    A set of them is a folder with ``image.exr``, ``image.png``, ``difference.png`` and
    ``thumbnail.png``.
    """
    return f"{of_job(job_id)}results/"


def result_set(job_id: str, spp: int, token: str) -> str:
    """Where the set of results lies that the monitor with this fencing token makes at `spp`."""
    return f"{results(job_id)}{spp:07d}-{token}"


def spp_of_set(name: str) -> int:
    """The spp in the name that `result_set` gave."""
    return int(name.rpartition("/")[2].partition("-")[0])


def previews(job_id: str) -> str:
    """What the names of all pictures that a job keeps of its way begin with."""
    return f"{of_job(job_id)}previews/"


def preview(job_id: str, spp: int) -> str:
    """Where the picture of the merged image at `spp` samples per pixel is kept."""
    return f"{previews(job_id)}{spp:07d}.png"


def spp_of_preview(name: str) -> int:
    """The spp in the name that `preview` gave."""
    return int(name.rpartition("/")[2].removesuffix(".png"))


def of_study(study_id: str) -> str:
    """What the names of all pictures of an observer study begin with."""
    return f"{STUDIES}{study_id}/"


def study_reference(study_id: str) -> str:
    """Where the picture of the reference of a study is kept."""
    return f"{of_study(study_id)}reference.png"


def study_level(study_id: str, spp: int) -> str:
    """Where the test picture of `spp` samples per pixel of a study is kept."""
    return f"{of_study(study_id)}{spp:07d}.png"


class StoredBlob(NamedTuple):
    """A blob in a listing."""

    name: str
    size: int  #: in bytes


class Blobs:
    """A folder, or any store that obstore opens by URL.

    Raises
    ------
    FileNotFoundError
        By the methods that read: there is no such blob.
    BlobsUnavailable
        By all: the store cannot be reached, is full or refuses.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self._folder = _folder(where)
        if self._folder is None:
            self._store = from_url(where)
        else:
            make_folder(self._folder)
            self._folders = FolderSync(self._folder)
            self._store = LocalStore(self._folder, automatic_cleanup=True)
        self._marked = self._folder is not None and (self._folder / MARK).exists()

    def mark(self) -> str | None:
        """What the store is marked with; None where it has no mark. See `farm.pairing`."""
        with suppress(FileNotFoundError):
            return self.get(MARK).decode(errors="replace")
        return None

    def make_mark(self, content: str) -> str:
        """Mark the store, once and for all; returns what it is marked with now."""
        with suppress(AlreadyExistsError), _store_errors(AlreadyExistsError):
            obstore.put(self._store, MARK, content.encode(), mode="create")
            if self._folder is not None:
                sync(self._folder / MARK)
                sync(self._folder)
        self._marked = self._folder is not None
        return self.get(MARK).decode(errors="replace")

    def put(self, name: str, content: bytes | BinaryIO) -> None:
        """Store a blob whole or not at all; on returning it is safe from a power loss.

        A put that fails leaves nothing behind, one that is killed may leave one of `leftovers`.
        """
        with _store_errors():
            if self._folder is None:
                obstore.put(self._store, name, content)
            else:
                self._check_mark()
                self._put_into(self._folder, name, content)

    def _put_into(self, folder: Path, name: str, content: bytes | BinaryIO) -> None:
        # On the disk before it has its name, so that the name never stands for half a blob.
        incoming = _INCOMING + secrets.token_hex(8)
        try:
            obstore.put(self._store, incoming, content)
            sync(folder / incoming)
            obstore.rename(self._store, incoming, name)
        except BaseException:
            for left in (folder / _INCOMING).glob(f"{Path(incoming).name}*"):  # parts have a suffix
                left.unlink(missing_ok=True)
            raise
        self._folders.up_from((folder / name).parent)

    def put_once(self, name: str, content: BinaryIO, size: int) -> None:
        """Store a blob whose name fixes its content, unless it is there already in its full size.

        One of another size was torn by what happened to the store, and is put again.
        """
        if self.size(name) != size:
            self.put(name, content)
        elif self._folder is not None:
            with _store_errors():  # whoever put it may not have come to that yet
                self._folders.up_from((self._folder / name).parent)

    def get(self, name: str) -> bytes:
        """The blob's bytes."""
        with _store_errors(FileNotFoundError), self._missing():
            return bytes(obstore.get(self._store, name).bytes())

    def chunks(self, name: str) -> Iterator[bytes]:
        """The blob's bytes, a few MB at a time."""
        with _store_errors(FileNotFoundError), self._missing():
            for chunk in obstore.get(self._store, name).stream(min_chunk_size=1 << 22):
                yield bytes(chunk)

    def size(self, name: str) -> int | None:
        """The blob's number of bytes; None where there is no such blob."""
        try:
            with _store_errors(FileNotFoundError), self._missing():
                return obstore.head(self._store, name)["size"]
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
            for page in obstore.list(self._store, prefix):
                for meta in page:
                    if not meta["path"].startswith((_INCOMING, MARK)):
                        yield StoredBlob(meta["path"], meta["size"])

    def delete(self, *names: str) -> None:
        """Remove blobs; one that is not there is fine."""
        for name in names:
            with suppress(FileNotFoundError), _store_errors(FileNotFoundError):
                obstore.delete(self._store, name)

    def leftovers(self, older_than_s: float) -> list[Path]:
        """The files that puts which were killed left in a folder, for the caller to remove.

        Parameters
        ----------
        older_than_s
            Longer than any put takes, so that none of those under way is among them.

        Notes
        -----
        An object store never shows half an upload; its own rules say how long it keeps one.
        """
        if self._folder is None:
            return []
        left = []
        for path in (self._folder / _INCOMING).glob("*"):
            with suppress(FileNotFoundError):  # its put has just ended
                if path.stat().st_mtime < time.time() - older_than_s:
                    left.append(path)
        return left

    @contextmanager
    def _missing(self) -> Iterator[None]:
        """Let a missing blob be missing only where the store itself is there."""
        try:
            yield
        except FileNotFoundError:
            self._check_mark()
            raise

    def _check_mark(self) -> None:
        """A folder that has lost its mark is not the store, but the place where it was mounted."""
        if self._marked and self._folder is not None and not (self._folder / MARK).exists():
            raise BlobsUnavailable(
                f"the blob store is not in {self._folder} any more: is it still mounted?"
            )


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
        # obstore appends its whole chain of causes, a line each.
        raise BlobsUnavailable(f"the blob store failed: {str(error).splitlines()[0]}") from error
