"""The folder that results are to be written into, looked at before there are any."""

import tempfile
from pathlib import Path

from plateau.errors import CommandFailed
from plateau.files.job_folder import RESULTS, require_free


def make(folder: Path, named_by: str = "-o", *, mode: int = 0o777) -> None:
    """Make a folder, and those above it, where there is none.

    Parameters
    ----------
    folder
        The folder.
    named_by
        The option or the setting that names it.
    mode
        Who may use it.

    Raises
    ------
    CommandFailed
        It cannot be made; the message says why and what to do.
    """
    try:
        folder.mkdir(mode=mode, parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        blocking = next(one for one in (folder, *folder.parents) if one.exists())
        raise CommandFailed(
            f"{named_by} needs a folder, and {blocking} is a file: name another one"
        ) from None
    except OSError as error:
        raise CommandFailed(
            f"the folder {folder} cannot be made ({error.strerror}): name another one with "
            f"{named_by}"
        ) from error


def make_ready(folder: Path) -> None:
    """Make the folder where there is none, and see that a job's results can be written into it.

    Raises
    ------
    CommandFailed
        They cannot; the message says why and what to do.
    """
    make_writable(folder)
    for name in RESULTS:
        if (folder / name).is_dir():
            raise CommandFailed(
                f"{folder / name} is a folder, and a file has to be written there: move it, "
                "or give another folder with -o"
            )
    require_free(folder)


def make_writable(folder: Path) -> None:
    """Make the folder where there is none, and see that something can be written into it.

    Raises
    ------
    CommandFailed
        It cannot; the message says why and what to do.
    """
    make(folder)
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(4096))
    except OSError as error:
        raise CommandFailed(
            f"nothing can be written into {folder} ({error.strerror}): give another folder with -o"
        ) from error
