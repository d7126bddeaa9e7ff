"""Writes a file into the folder that it is given; says why it cannot.

A process of its own: where the folder's disk does not answer, the write never returns.
"""

import sys
import tempfile
from pathlib import Path
from typing import Final

_FILE_BYTES: Final = 1 << 20


def main(folder: Path) -> None:
    """Write and remove the file; exit with words where that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_FILE_BYTES))
            file.flush()
    except OSError as error:
        sys.exit(f"cannot write into {folder}: {error.strerror}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
