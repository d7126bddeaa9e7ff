"""The folder that results are to be written into, looked at before there are any."""

import tempfile
from collections.abc import Sequence
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


def make_ready(folder: Path, files: Sequence[str] = RESULTS) -> None:
    """Make the folder where there is none, and see that these files can be written into it.

    Raises
    ------
    CommandFailed
        They cannot; the message says why and what to do.
    OSError
        The folder cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(4096))
    except OSError as error:
        raise CommandFailed(
            f"nothing can be written into {folder} ({error.strerror}): give another folder with -o"
        ) from error
    for name in files:
        if (folder / name).is_dir():
            raise CommandFailed(
                f"{folder / name} is a folder, and a file of that name is to be written: move it, "
                "or give another folder with -o"
            )
