"""Scenes from the blob store, unpacked once on this machine."""

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from uuid import uuid4

from plateau.farm.blobs import store as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import unpack_bundle
from plateau.farm.model.errors import CorruptBlob, StoreUnavailable
from plateau.farm.process.durable import sync_tree

#: So many scenes stay unpacked, and more while they are in use; the one unused for longest goes
#: first.
_KEPT: Final = 16
_ABANDONED_S: Final = 86_400.0  #: no scene takes so long to fetch and unpack
_CHUNK_BYTES: Final = 1 << 20
#: How an OpenEXR file begins, whatever it is called.
_OPENEXR: Final = b"\x76\x2f\x31\x01"


class SceneCache:
    """A folder of unpacked scenes, named by their SHA-256; workers of one machine share it.

    Parameters
    ----------
    store
        Where scenes come from.
    folder
        Where they lie; made where it is missing.
    in_use_s
        A scene that was asked for may be read for so many seconds: it is not forgotten till then.
    """

    def __init__(self, store: Blobs, folder: Path, in_use_s: float) -> None:
        self._blobs = store
        self.folder = folder
        self._in_use_s = in_use_s

    def make_folder(self) -> tuple[int, int]:
        """Make the folder where it is missing, and return which one it is: its device and inode.

        Raises
        ------
        StoreUnavailable
            This machine's disk failed: it may be full.
        """
        with _disk_errors(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            status = self.folder.stat()
            return status.st_dev, status.st_ino

    def scene(self, sha256: str) -> tuple[Path, str]:
        """The scene's folder and the name of its main XML in it.

        Raises
        ------
        FileNotFoundError
            The blob store does not have the scene.
        CorruptBlob
            What the blob store has, or what arrived of it, is not the scene of this SHA-256.
        BundleError
            It is not a scene that may be unpacked.
        StoreUnavailable
            The blob store failed, or this machine's disk: it may be full.
        """
        home = self.folder / sha256
        if not self._is_there(home):
            self._unpack(sha256, home)
        with _disk_errors(self.folder):
            self._forget_oldest()
            return home / "files", (home / "entry").read_text()

    def _is_there(self, home: Path) -> bool:
        """Whether the scene is unpacked; if so, it is in use from now on."""
        with _disk_errors(self.folder), suppress(FileNotFoundError):
            os.utime(home)
            return (home / "entry").exists()
        return False

    def _unpack(self, sha256: str, home: Path) -> None:
        self.make_folder()
        with _disk_errors(self.folder):
            # Made apart and moved into place, so that nobody sees half a scene.
            making = Path(tempfile.mkdtemp(prefix=".making-", dir=self.folder))
        try:
            bundle = making / "bundle"
            self._fetch(sha256, bundle)
            with _disk_errors(self.folder):
                (making / "files").mkdir()
                entry = unpack_bundle(bundle, making / "files")
                bundle.unlink()
                (making / "entry").write_text(entry)
                sync_tree(making)  # or a power loss might leave a scene of empty files in place
                _move(making, home)
                os.utime(home)
        finally:
            shutil.rmtree(making, ignore_errors=True)

    def _fetch(self, sha256: str, path: Path) -> None:
        """Write the scene's blob to a file, and read that back to see that it is what was asked."""
        chunks = self._blobs.chunks(blobs.scene(sha256))
        first = next(chunks, b"")  # here it shows whether there is such a blob
        with _disk_errors(self.folder):
            with path.open("wb") as file:
                file.write(first)
                file.writelines(chunks)
            found = _sha256(path)
        if found != sha256:
            raise CorruptBlob(
                f"the scene {sha256} is damaged: what was fetched has the SHA-256 {found}; where "
                f"that happens again, remove the blob {blobs.scene(sha256)} and submit the scene "
                "once more"
            )

    def _forget_oldest(self) -> None:
        """Remove what has not been used for longest, and what a killed worker was making."""
        homes: list[tuple[float, Path]] = []
        for home in self.folder.iterdir():
            with suppress(FileNotFoundError):  # another worker has forgotten it
                homes.append((home.stat().st_mtime, home))
        now = time.time()
        made = sorted(one for one in homes if not one[1].name.startswith("."))
        for asked_at, home in made[:-_KEPT]:
            if asked_at < now - self._in_use_s:
                self._forget(home)
        for made_at, home in homes:
            if made_at < now - _ABANDONED_S and home.name.startswith("."):
                shutil.rmtree(home, ignore_errors=True)

    def _forget(self, home: Path) -> None:
        """Remove a scene, unless another worker asks for it at this moment."""
        # Taken away whole, so that nobody is ever given what is left of it.
        gone = self.folder / f".forgotten-{uuid4().hex}"
        with suppress(OSError):  # another worker has forgotten it, or made it anew
            home.rename(gone)
            if gone.stat().st_mtime > time.time() - self._in_use_s:
                gone.rename(home)
        shutil.rmtree(gone, ignore_errors=True)


def loading_threads(folder: Path) -> int:
    """Return how many threads load a scene: one, so that sums have the same last bits every time.

    Normals are such sums, where a mesh has none and Mitsuba makes them of its faces'. But with one
    thread it waits for ever for another that reads an OpenEXR file.
    """
    files = (path for path in folder.rglob("*") if path.is_file())
    return 2 if any(map(_is_openexr, files)) else 1


def _is_openexr(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(_OPENEXR)) == _OPENEXR


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _move(making: Path, home: Path) -> None:
    try:
        making.rename(home)
    except OSError:
        if not (home / "entry").exists():  # not merely another worker that was quicker
            raise


@contextmanager
def _disk_errors(folder: Path) -> Iterator[None]:
    """Raise `StoreUnavailable` where this machine's disk fails: another try may go better."""
    try:
        yield
    except OSError as error:
        raise StoreUnavailable(
            f"the scene cannot be unpacked in {folder}: {error.strerror or error}"
        ) from error
