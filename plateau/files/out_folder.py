"""Makes, checks and holds the folder for results; an unsuitable one raises `CommandFailed`."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from plateau.errors import CommandFailed
from plateau.files.held import held
from plateau.files.job_folder import RESULTS, require_free


def make(folder: Path, named_by: str = "-o", *, mode: int = 0o777) -> None:
    """Make a folder and its parents; `named_by` is the option or setting that names it."""
    try:
        folder.mkdir(mode=mode, parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        blocking = next(one for one in (folder, *folder.parents) if one.exists())
        raise CommandFailed(
            f"{named_by} needs a folder, and {blocking} is a file: name another one"
        ) from None
    except OSError as error:
        raise CommandFailed(
            f"cannot make the folder {folder} ({error.strerror}): name another one with {named_by}"
        ) from error


@contextmanager
def ready(folder: Path) -> Iterator[None]:
    """Make the folder if it is missing, check that it can take a job's results, and hold it."""
    make_writable(folder)
    with held(folder):
        for name in RESULTS:
            if (folder / name).is_dir():
                raise CommandFailed(
                    f"{folder / name} is a folder, and a file of this name must be written: move "
                    "it, or give another folder with -o"
                )
        require_free(folder)
        yield


def make_writable(folder: Path) -> None:
    """Make the folder if it is missing, and check that files can be written into it."""
    if folder.suffix.lower() in {".exr", ".png"} and not folder.is_dir():
        raise CommandFailed(
            f"-o {folder} names an image, and results are several files: name a folder, such as "
            f"{folder.stem}"
        )
    make(folder)
    try_writing(folder, bytes_=4096)


def try_writing(folder: Path, named_by: str = "-o", *, bytes_: int = 0) -> None:
    """Check that a file of this size can be written into the folder."""
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(bytes_))
    except OSError as error:
        raise CommandFailed(
            f"cannot write into {folder} ({error.strerror}): give another folder with {named_by}"
        ) from error
