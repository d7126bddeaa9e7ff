"""The folder for a job's results: it holds the files of one job at any time.

A hidden file names the job. It is written after the last file of an earlier job is removed and
before the first file of the new one, so the folder is consistent even if its writer is killed.
Files with other names are never touched.
"""

import fcntl
import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed

#: What an older service does not know.
NOISE_MAP: Final = "noise.png"
#: What only a job has that goes by ColorVideoVDP.
QUALITY_MAP: Final = "quality.png"
#: What only a job that is allocated by zones has.
SPP_MAP: Final = "spp.png"
IMAGES: Final = (
    *("image.exr", "image.png", "difference.png"),
    *(NOISE_MAP, QUALITY_MAP, SPP_MAP, "non-finite.png"),
)
#: The files of a job, beside the folder of its slices.
RESULTS: Final = (
    *IMAGES,
    *("curve.csv", "curve.svg", "report.html", "summary.txt", "summary.json"),
)
SLICES: Final = "slices"

#: The file with the id of the folder's job.
_OWNER: Final = ".plateau-job"

_SLICE: Final = re.compile(r"\d{6}\.exr")
_REMEDY: Final = "move {} away, or give another folder with -o"

#: Files that a killed writer has left.
_UNFINISHED: Final = re.compile(
    rf"\.[0-9a-f]{{8}}\.({'|'.join(map(re.escape, (*RESULTS, _OWNER)))}|{_SLICE.pattern})"
)
#: The folder of a job of a batch, by its place and its id.
_FRAME: Final = re.compile(r"\d{4,}-([0-9a-f]{12})")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to; `path` is replaced at the end, and after an error unchanged."""
    unfinished = path.with_name(f".{secrets.token_hex(4)}.{path.name}")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def in_turn(folder: Path) -> Iterator[None]:
    """Lock the folder for the context, so no other process writes results into it.

    A folder that cannot be made, or a file system without locks, is not locked.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, descriptor)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield


def begin(folder: Path, job_id: str, keeps: Callable[[Path], bool]) -> None:
    """Make an existing folder that of a job: remove the old results, and write the job's id.

    `keeps` tells whether the file of a slice is this job's; it is then kept.
    """
    before = owner(folder)
    if before is not None:
        for path in _ours(folder):
            if path.parent == folder or not (_SLICE.fullmatch(path.name) and keeps(path)):
                path.unlink()
        with suppress(OSError):  # it is missing, or not empty
            (folder / SLICES).rmdir()
    _claim(folder, job_id)


def owner(folder: Path) -> str | None:
    """The id of the job whose files the folder has; None if there is none."""
    with suppress(OSError, ValueError):
        return (folder / _OWNER).read_text().strip()
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


def _claim(folder: Path, job_id: str) -> None:
    with whole(folder / _OWNER) as path:
        path.write_text(f"{job_id}\n")


def _ours(folder: Path) -> list[Path]:
    """All files of a job in the folder: results, slices and unfinished files."""
    found = [folder / name for name in RESULTS]
    found += [path for path in folder.iterdir() if _UNFINISHED.fullmatch(path.name)]
    if (folder / SLICES).is_dir():
        found += [
            path
            for path in (folder / SLICES).iterdir()
            if _SLICE.fullmatch(path.name) or _UNFINISHED.fullmatch(path.name)
        ]
    return [path for path in found if path.is_file() or path.is_symlink()]


def _frames(folder: Path) -> list[Path]:
    """The folders of a batch's jobs within the folder."""
    if not folder.is_dir():
        return []
    found = (path for path in folder.iterdir() if _FRAME.fullmatch(path.name))
    return sorted(path for path in found if path.is_dir() and owner(path) is not None)
