"""Scenes from the blob store, unpacked once on this machine."""

import os
import shutil
import tempfile
from pathlib import Path
from typing import Final

from farm import blobs
from farm.blobs import Blobs
from farm.bundle import unpack_bundle

#: So many scenes stay unpacked; the one unused for longest goes first.
_KEPT: Final = 16


class SceneCache:
    """A folder of unpacked scenes, named by their SHA-256; workers of one machine share it."""

    def __init__(self, store: Blobs, folder: Path) -> None:
        self._blobs = store
        self._folder = folder

    def scene(self, sha256: str) -> tuple[Path, str]:
        """The scene's folder and the name of its main XML in it.

        Raises
        ------
        FileNotFoundError
            The blob store does not have the scene.
        BundleError
            It is not a scene that may be unpacked.
        StoreUnavailable
            The blob store failed.
        """
        home = self._folder / sha256
        if not (home / "entry").exists():
            self._unpack(sha256, home)
        os.utime(home)
        self._forget_oldest()
        return home / "files", (home / "entry").read_text()

    def _unpack(self, sha256: str, home: Path) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        # Made apart and moved into place, so that nobody sees half a scene.
        making = Path(tempfile.mkdtemp(prefix=".making-", dir=self._folder))
        try:
            bundle = making / "bundle"
            with bundle.open("wb") as file:
                for chunk in self._blobs.chunks(blobs.scene(sha256)):
                    file.write(chunk)
            (making / "files").mkdir()
            entry = unpack_bundle(bundle, making / "files")
            bundle.unlink()
            (making / "entry").write_text(entry)
            try:
                making.rename(home)
            except OSError:
                if not (home / "entry").exists():  # not merely another worker that was quicker
                    raise
        finally:
            shutil.rmtree(making, ignore_errors=True)

    def _forget_oldest(self) -> None:
        homes = [home for home in self._folder.iterdir() if not home.name.startswith(".")]
        for home in sorted(homes, key=lambda home: home.stat().st_mtime)[:-_KEPT]:
            shutil.rmtree(home, ignore_errors=True)
