"""The folder for a job's results: it holds the files of one job at any time.

They are written into a hidden folder within it, and take the place of those of an earlier job when
all are there. A hidden file names the job. It is written after the last file of an earlier job is
removed and before the first file of the new one, so the folder is consistent even if its writer is
killed between two of these steps. Files with other names are never touched.
"""

import errno
import os
import re
import shutil
import signal
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed
from plateau.files.held import held, refuse_held

IMAGES: Final = (
    *("image.exr", "image.png", "difference.png"),
    *("noise.png", "quality.png", "spp.png", "non-finite.png"),
)
#: The files of a job, beside the folder of its slices.
RESULTS: Final = (*IMAGES, "curve.csv", "curve.svg", "summary.txt", "summary.json")
SLICES: Final = "slices"

#: The file with the id of the folder's job.
_OWNER: Final = ".plateau-job"

_SLICE: Final = re.compile(r"\d{6}\.exr")
_REMEDY: Final = "move {} away, or give another folder with -o"

#: The folder of the files that are to become those of the job.
_NEW: Final = ".plateau-new"
#: The folder of a job of a batch, by its place and its id.
_FRAME: Final = re.compile(r"\d{4,}-([0-9a-f]{12})")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to; `path` is replaced at the end, and after an error unchanged.

    Raises
    ------
    Held
        Somebody else writes the file, or holds its folder.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():  # a pipe, or /dev/stdout
        yield path
        return
    unfinished = path.with_name(f".{path.name}.part")
    refuse_held(path.parent)
    with held(path):
        try:
            yield unfinished
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)


class NewSet:
    """Files that take the place of a folder's results together, or not at all.

    The caller holds the folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.place: Final = folder / _NEW  #: where the new files are written

    def begin(self) -> None:
        """Make the place for the new files, without those that a killed process has left there.

        Slices stay: they are many, and are known by their hashes.
        """
        self.place.mkdir(parents=True, exist_ok=True)
        for path in _ours(self.place):
            if path.parent == self.place:
                path.unlink()

    def commit(self, job_id: str, kept: Collection[str]) -> None:
        """Put the new files in the place of the old results; slices that are `kept` stay."""
        new = [path for path in _ours(self.place) if path.parent == self.place]
        slices = sorted(self.place.glob(f"{SLICES}/*"))
        for path in (self._folder / path.name for path in new):
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if kept or slices:
            (self._folder / SLICES).mkdir(exist_ok=True)
        (self.place / _OWNER).write_text(f"{job_id}\n", encoding="utf-8")
        with _unbroken():
            if owner(self._folder) is not None:
                for path in _ours(self._folder):
                    if path.parent == self._folder or path.name not in kept:
                        path.unlink()
            (self.place / _OWNER).replace(self._folder / _OWNER)
            for path in slices:
                path.replace(self._folder / SLICES / path.name)
            for path in new:  # summary.json last, by which a job of a batch is there
                path.replace(self._folder / path.name)
            with suppress(OSError):  # it is missing, or not empty
                (self._folder / SLICES).rmdir()
        self.drop()

    def drop(self) -> None:
        """Remove the new files."""
        shutil.rmtree(self.place, ignore_errors=True)


@contextmanager
def _unbroken() -> Iterator[None]:
    """Have signals wait until the context ends."""
    came: list[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) not in {signal.SIG_IGN, None}:
                before[number] = signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for late in came:
            signal.raise_signal(late)


def owner(folder: Path) -> str | None:
    """The id of the job whose files the folder has; None if there is none."""
    with suppress(OSError, ValueError):
        return (folder / _OWNER).read_text(encoding="utf-8").strip()
    return None


def frame(folder: Path, place: int, job_id: str) -> Path:
    """The folder of a batch's job, within that of the batch; `place` counts from 0."""
    return folder / f"{place:04d}-{job_id}"


def require_free(folder: Path) -> None:
    """Raise `CommandFailed` if a job's results would be lost in the folder, or overwrite files.

    Such a folder has the results of a batch, or a file with a result's name that no job wrote.
    """
    if frames := _frames(folder):
        raise CommandFailed(
            f"{folder} has the results of a batch ({frames[0].name}): {_REMEDY.format('them')}"
        )
    taken = [folder / name for name in RESULTS if (folder / name).exists()]
    if taken and owner(folder) is None:
        raise CommandFailed(
            f"{taken[0]} is there, and Plateau did not write it as a job's result: "
            f"{_REMEDY.format('it')}"
        )


def require_free_for_batch(folder: Path, job_ids: list[str]) -> None:
    """Raise `CommandFailed` if the folder has results of other jobs than these of a batch."""
    other = owner(folder)
    if other is not None:
        raise CommandFailed(f"{folder} has the results of job {other}: {_REMEDY.format('them')}")
    others = [one for one in _frames(folder) if one.name.rpartition("-")[2] not in job_ids]
    if others:
        raise CommandFailed(
            f"{folder} has results that are not of this batch ({others[0].name}): "
            f"{_REMEDY.format('them')}"
        )


def _ours(folder: Path) -> list[Path]:
    """All files of a job in the folder: results and slices."""
    found = [folder / name for name in RESULTS]
    found += [path for path in folder.glob(f"{SLICES}/*") if _SLICE.fullmatch(path.name)]
    return [path for path in found if path.is_file() or path.is_symlink()]


def _frames(folder: Path) -> list[Path]:
    """The folders of a batch's jobs within the folder."""
    if not folder.is_dir():
        return []
    found = (path for path in folder.iterdir() if _FRAME.fullmatch(path.name))
    return sorted(path for path in found if path.is_dir() and owner(path) is not None)
