"""A disk in a file, and what a power loss leaves of it.

Killing a process proves nothing about durability: what it wrote is in the kernel's memory and gets
to the disk in the end. Here the disk is an ext4 image on a loop device, told to write back next to
nothing by itself (``commit=300``). A copy of the image holds what the disk held at that moment and
nothing of the kernel's memory, which is what a power loss leaves.
"""

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.support.missing import missing
from tests.support.until import until

_ROOT: Final = 0
#: Administrators' commands are not on everybody's PATH.
_PATH: Final = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"


class LoopDisk:
    """A small disk, mounted while the context lasts.

    Without root or loop devices the test skips.

    Parameters
    ----------
    home
        Folder for the image and the mount; made.
    megabytes
        Size of the disk.
    image
        An image to mount instead of a new one.
    """

    def __init__(self, home: Path, *, megabytes: int = 64, image: Path | None = None) -> None:
        self.folder = home / "mounted"
        self.folder.mkdir(parents=True)
        self._image = image or home / "image"
        if image is None:
            _needs_root_and_loop_devices()
            with self._image.open("wb") as file:
                file.truncate(megabytes << 20)
            _run("mkfs.ext4", "-q", "-F", "-m", "0", str(self._image))

    def __enter__(self) -> "LoopDisk":
        self.mount()
        return self

    def __exit__(self, *error: object) -> None:
        self.unmount()
        self._image.unlink()

    def mount(self) -> None:
        """Mount it, or mount it again."""
        # mount takes a free loop device, and umount gives it back.
        _run("mount", "-o", "loop,commit=300", str(self._image), str(self.folder))

    def unmount(self) -> None:
        """Take it away: its folder is an empty one of the disk below."""
        # Lazily, so that it goes with its last user where something still uses it.
        _run("umount", "--lazy", str(self.folder))

    def fill(self, leaving: int = 0) -> Path:
        """Leave room for so many bytes; returns the file that takes the rest."""
        ballast = self.folder / "ballast"
        with ballast.open("wb", buffering=0) as file:
            with contextlib.suppress(OSError):
                while True:
                    file.write(bytes(1 << 12))
            file.truncate(max(0, file.tell() - leaving))
        return ballast

    def free(self) -> None:
        """Give back the room that `fill` took."""
        (self.folder / "ballast").unlink()

    def make_read_only(self) -> None:
        """Mount it anew so that nothing can be written, as soon as nothing is being written."""
        until(lambda: subprocess.call(["mount", "-o", "remount,ro", self.folder]) == 0)

    def make_writable(self) -> None:
        """Mount it anew as it was."""
        _run("mount", "-o", "remount,rw", str(self.folder))

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """Have every write wait while the context lasts; no signal ends such a wait."""
        _run("fsfreeze", "--freeze", str(self.folder))
        try:
            yield
        finally:
            _run("fsfreeze", "--unfreeze", str(self.folder))

    def after_power_loss(self, home: Path) -> "LoopDisk":
        """The disk as it is now, without what the kernel still has in memory: another, to mount."""
        home.mkdir()
        copy = home / "image"
        shutil.copyfile(self._image, copy)
        return LoopDisk(home, image=copy)


def _needs_root_and_loop_devices() -> None:
    lacking = [
        name
        for name, there in (
            ("root", os.geteuid() == _ROOT),
            ("a loop device", Path("/dev/loop-control").exists()),
        )
        if not there
    ]
    if lacking:  # what nobody can install
        pytest.skip(f"a disk of our own needs {' and '.join(lacking)}")
    if shutil.which("mkfs.ext4", path=_PATH) is None:
        missing("a disk of our own needs mkfs.ext4 (Debian: e2fsprogs)")


def _run(*command: str) -> None:
    environment = {**os.environ, "PATH": _PATH}
    subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
