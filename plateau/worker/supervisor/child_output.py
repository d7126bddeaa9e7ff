"""What a render child prints: it writes a file, of which its supervisor reads the end."""

import fcntl
import os
import re
import tempfile
from typing import IO, Final

_MOST_BYTES: Final = 4096  #: of one reading
_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")


class Words:
    """A file without a name: nothing of it remains, whichever process dies."""

    def __init__(self) -> None:
        #: For the child's standard output and error.
        self.file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (see `close`)
        # The child then writes at the end, also after the file was emptied.
        fcntl.fcntl(self.file, fcntl.F_SETFL, os.O_APPEND)
        self._left = ""  # the words of a dead child

    def take(self) -> str:
        """Return the end of what was printed since the last call: 4 KB at most, uncoloured."""
        words = self.read()
        self._left = ""
        if not self.file.closed:
            os.ftruncate(self.file.fileno(), 0)
        return words

    def read(self) -> str:
        """Return the same, and leave it there."""
        if self.file.closed:
            return self._left
        # By position: the child shares the file's offset.
        file = self.file.fileno()
        start = max(0, os.fstat(file).st_size - _MOST_BYTES)
        words = os.pread(file, _MOST_BYTES, start).decode(errors="replace")
        return _COLOURS.sub("", words).strip()

    def close(self) -> None:
        """Keep the words that were not taken, and close the file."""
        self._left = self.read()
        self.file.close()
