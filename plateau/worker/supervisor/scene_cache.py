"""Scenes from the blob store, unpacked once on this machine."""

import errno
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final
from uuid import uuid4

from plateau.farm.blobs import names as blobs
from plateau.farm.blobs.store import Blobs
from plateau.farm.bundle import BundleLimits, unpack_bundle
from plateau.farm.bundle.hashes import sha256_of
from plateau.farm.model.errors import CorruptBlob, StoreUnavailable
from plateau.farm.process.durable import sync_tree
from plateau.worker.supervisor.placed_files import NO_ROOTS, PlacedFiles

#: The service has limited the size of what it took.
_TAKEN: Final = BundleLimits(max_bytes=2**63)
#: How many scenes stay unpacked, besides those in use. The one unused for longest goes first.
_KEPT: Final = 16
_ABANDONED_S: Final = 86_400.0  #: no scene takes this long to fetch and unpack
#: The first bytes of an OpenEXR file, whatever its name.
_OPENEXR: Final = b"\x76\x2f\x31\x01"


class SceneCache:
    """A folder of unpacked scenes, named by their SHA-256; workers of one machine share it.

    Files that a scene names in a scene root are no part of it: `PlacedFiles.link` links them.

    A scene may be read for `in_use_s` seconds after `scene` returned it; it is kept until then.
    """

    def __init__(
        self, store: Blobs, folder: Path, in_use_s: float, placed: PlacedFiles = NO_ROOTS
    ) -> None:
        self._blobs = store
        self.folder = folder
        self._in_use_s = in_use_s
        self.placed = placed

    def make_folder(self) -> tuple[int, int]:
        """Make the folder if it is missing, and return its device and inode.

        Raises
        ------
        StoreUnavailable
            This machine's disk failed; it may be full.
        """
        with _disk_errors(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            status = self.folder.stat()
            return status.st_dev, status.st_ino

    def scene(self, sha256: str) -> tuple[Path, str]:
        """Return the scene's folder and the name of its main XML in it.

        Raises
        ------
        FileNotFoundError
            The blob store does not have the scene.
        CorruptBlob
            The stored or the fetched bytes do not have this SHA-256.
        BundleError
            The bundle must not be unpacked.
        StoreUnavailable
            The blob store failed, or this machine's disk, which may be full.
        """
        home = self.folder / sha256
        if not self._is_there(home):
            try:
                self._unpack(sha256, home)
            except StoreUnavailable as error:
                if getattr(error.__cause__, "errno", 0) in {errno.ENOSPC, errno.EDQUOT}:
                    with suppress(OSError):  # the next try may have the room of what nobody loads
                        self._forget_oldest(0)
                raise
        with _disk_errors(self.folder):
            self._forget_oldest()
            return home / "files", (home / "entry").read_text(encoding="utf-8")

    def _is_there(self, home: Path) -> bool:
        """Return whether the scene is unpacked; if so, it is in use from now on."""
        with _disk_errors(self.folder), suppress(FileNotFoundError):
            os.utime(home)
            return (home / "entry").exists()
        return False

    def _unpack(self, sha256: str, home: Path) -> None:
        self.make_folder()
        with _disk_errors(self.folder):
            # Made apart and moved into place, so that no worker sees half a scene.
            making = Path(tempfile.mkdtemp(prefix=".making-", dir=self.folder))
        try:
            bundle = making / "bundle"
            self._fetch(sha256, bundle)
            with _disk_errors(self.folder):
                (making / "files").mkdir()
                entry = unpack_bundle(bundle, making / "files", _TAKEN)
                self.placed.name(making / "files", home.absolute() / "files")
                bundle.unlink()
                (making / "entry").write_text(entry, encoding="utf-8")
                sync_tree(making)  # else a power loss might leave a scene of empty files
                _move(making, home)
                os.utime(home)
        finally:
            shutil.rmtree(making, ignore_errors=True)

    def _fetch(self, sha256: str, path: Path) -> None:
        """Write the scene's blob to a file, and check the SHA-256 of what was written."""
        chunks = self._blobs.chunks(blobs.scene(sha256))
        first = next(chunks, b"")  # raises if the blob does not exist
        with _disk_errors(self.folder), path.open("w+b") as file:
            file.write(first)
            file.writelines(chunks)
            file.seek(0)
            found = sha256_of(file)
        if found != sha256:
            raise CorruptBlob(
                f"the scene {sha256} is damaged: what was fetched has the SHA-256 {found}; if that "
                f"happens again, remove the blob {blobs.scene(sha256)} and submit the scene again"
            )

    def _forget_oldest(self, kept: int = _KEPT) -> None:
        """Remove the scenes unused for longest, and what killed workers were unpacking."""
        homes: list[tuple[float, Path]] = []
        for home in self.folder.iterdir():
            with suppress(FileNotFoundError):  # another worker has removed it
                homes.append((home.stat().st_mtime, home))
        now = time.time()
        made = sorted(one for one in homes if not one[1].name.startswith("."))
        for asked_at, home in made[: -kept or None]:
            if asked_at < now - self._in_use_s:
                self._forget(home)
        for made_at, home in homes:
            if made_at < now - _ABANDONED_S and home.name.startswith("."):
                shutil.rmtree(home, ignore_errors=True)

    def _forget(self, home: Path) -> None:
        """Remove a scene, unless another worker asks for it at this moment."""
        # Renamed first, so that no worker is ever given a part of it.
        gone = self.folder / f".forgotten-{uuid4().hex}"
        with suppress(OSError):  # another worker has removed it, or unpacked it again
            home.rename(gone)
            if gone.stat().st_mtime > time.time() - self._in_use_s:
                gone.rename(home)
        shutil.rmtree(gone, ignore_errors=True)


def loading_threads(folder: Path) -> int:
    """Return how many threads load a scene: one, so that sums have the same last bits every time.

    Mitsuba computes such sums for the normals of a mesh that has none. A scene with an OpenEXR file
    needs two: one thread would wait for ever for another that reads the file.
    """
    files = (path for path in folder.rglob("*") if path.is_file())
    return 2 if any(map(_is_openexr, files)) else 1


def _is_openexr(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(_OPENEXR)) == _OPENEXR


def _move(making: Path, home: Path) -> None:
    try:
        making.rename(home)
    except OSError:
        if not (home / "entry").exists():  # else another worker was quicker
            raise


@contextmanager
def _disk_errors(folder: Path) -> Iterator[None]:
    """Raise `StoreUnavailable` if this machine's disk fails: another try may succeed."""
    try:
        yield
    except OSError as error:
        raise StoreUnavailable(
            f"the scene cannot be unpacked in {folder}: {error.strerror or error}"
        ) from error
