"""Log files that processes go on writing to, and that stay short all the same."""

import contextlib
import os
import shutil
from pathlib import Path
from typing import Final

#: A log that is longer is begun anew; as much again is in the one before it.
MOST_BYTES: Final = 10_000_000


def rotate(log: Path, most_bytes: int = MOST_BYTES) -> bool:
    """Begin a log anew that is too long, and keep what it had as ``NAME.log.1``; return whether.

    Who writes to it goes on, in append mode, and need not know. A line that is written between the
    copy and the cut is lost. Where the disk has no room for the copy, there is none.
    """
    try:
        if log.stat().st_size <= most_bytes:
            return False
        with contextlib.suppress(OSError):
            shutil.copyfile(log, log.with_suffix(".log.1"))
        os.truncate(log, 0)
    except OSError:
        return False  # it is not there, or not ours
    return True
