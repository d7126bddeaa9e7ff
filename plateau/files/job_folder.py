"""The folder that a job's results are written into: what it holds is of one job, always.

A hidden file says of which one. It is written before that job's first file, and after the last one
of an earlier job is gone, so that whoever finds the folder, whenever its writer was killed, sees
the files of one job. Files with other names are nobody's business, and stay.
"""

import fcntl
import json
import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from plateau.errors import CommandFailed

IMAGES: Final = ("image.exr", "image.png", "difference.png", "non-finite.png")
#: What a job leaves in its folder, beside the folder of its slices.
RESULTS: Final = (
    *IMAGES,
    "curve.csv",
    "curve.png",
    "summary.txt",
    "summary.json",
)
SLICES: Final = "slices"

#: Says whose files a folder has: a job's id.
_OWNER: Final = ".plateau-job"

_SLICE: Final = re.compile(r"\d{6}\.exr")
_REMEDY: Final = "move {} away, or give another folder with -o"

#: What a writer that was killed has left.
_UNFINISHED: Final = re.compile(
    rf"\.[0-9a-f]{{8}}\.({'|'.join(map(re.escape, (*RESULTS, _OWNER)))}|{_SLICE.pattern})"
)
#: The folder of a job of a batch, by its place and its id.
_FRAME: Final = re.compile(r"\d{4,}-([0-9a-f]{12})")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path to write to: at the end the file is there whole; after an error, as it was."""
    unfinished = path.with_name(f".{secrets.token_hex(4)}.{path.name}")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def in_turn(folder: Path) -> Iterator[None]:
    """While the context lasts, nobody else writes a job's results into the folder.

    Where it cannot be locked (it cannot be made, a file system has no locks), it is not.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, descriptor)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield


def begin(folder: Path, job_id: str, keeps: Callable[[Path], bool]) -> None:
    """Remove what another job left, and all that this one will write anew; say whose folder it is.

    Parameters
    ----------
    folder
        It exists.
    job_id
        The job of which files are to be written.
    keeps
        Whether a slice, by its path, is one of this job's already.

    Raises
    ------
    OSError
        Something cannot be removed or written.
    """
    before = owner(folder)
    if before is not None:
        _claim(folder, before)  # a summary may be all that says so, and goes with the others
        for path in _ours(folder):
            if path.parent == folder or not (_SLICE.fullmatch(path.name) and keeps(path)):
                path.unlink()
        with suppress(OSError):  # there is none, or something is left in it
            (folder / SLICES).rmdir()
    _claim(folder, job_id)


def owner(folder: Path) -> str | None:
    """The id of the job whose files the folder has; None where it has no job's."""
    with suppress(OSError, ValueError):
        return (folder / _OWNER).read_text().strip()
    with suppress(OSError, ValueError, KeyError, TypeError):  # as a Plateau before this one left it
        about = json.loads((folder / "summary.json").read_text())
        return str(about["id"]) if "scene_sha256" in about else None
    return None


def frame(folder: Path, place: int, job_id: str) -> Path:
    """The folder of a job of a batch, in that of the batch; `place` counts from 0."""
    return folder / f"{place:04d}-{job_id}"


def require_free(folder: Path) -> None:
    """See that nothing would be lost or mixed if a job's results were written into the folder.

    Raises
    ------
    CommandFailed
        It has the results of a batch, or a file of somebody else has the name of a result.
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
    """The same for a batch of these jobs, each of which has a folder of its own in this one.

    Raises
    ------
    CommandFailed
        It has the results of another job or of another batch.
    """
    other = owner(folder)
    if other is not None:
        raise CommandFailed(f"{folder} has the results of job {other}: {_REMEDY.format('them')}")
    strangers = [path for path in _frames(folder) if _job_of(path) not in job_ids]
    if strangers:
        raise CommandFailed(
            f"{folder} has results that are not of this batch ({strangers[0].name}): "
            f"{_REMEDY.format('them')}"
        )


def _claim(folder: Path, job_id: str) -> None:
    with whole(folder / _OWNER) as path:
        path.write_text(f"{job_id}\n")


def _ours(folder: Path) -> list[Path]:
    """What a job has left in the folder: its results, its slices, and what was not finished."""
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
    """The folders of a batch's jobs in the folder."""
    if not folder.is_dir():
        return []
    found = (path for path in folder.iterdir() if _FRAME.fullmatch(path.name))
    return sorted(path for path in found if path.is_dir() and owner(path) is not None)


def _job_of(frame: Path) -> str:
    return frame.name.rpartition("-")[2]
