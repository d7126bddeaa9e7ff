"""What a render child prints: a file that it writes, and whose end its supervisor takes."""

import fcntl
import os
import re
import tempfile
from typing import IO, Final

_MOST_BYTES: Final = 4096  #: of what is taken at once
_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")


class Words:
    """A file without a name, so that nothing is left of it whoever dies."""

    def __init__(self) -> None:
        #: For the child's standard output and error.
        self.file: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (see `close`)
        # So that the child goes on at the end, wherever that is when its words have been taken.
        fcntl.fcntl(self.file, fcntl.F_SETFL, os.O_APPEND)
        self._left = ""  # of a child that is dead

    def take(self) -> str:
        """What was printed since the last call: its end, 4 KB at most, uncoloured."""
        words = self.read()
        self._left = ""
        if not self.file.closed:
            os.ftruncate(self.file.fileno(), 0)
        return words

    def read(self) -> str:
        """The same, and leave it there."""
        if self.file.closed:
            return self._left
        # By position: the place in the file is the child's as well.
        file = self.file.fileno()
        start = max(0, os.fstat(file).st_size - _MOST_BYTES)
        words = os.pread(file, _MOST_BYTES, start).decode(errors="replace")
        return _COLOURS.sub("", words).strip()

    def close(self) -> None:
        """Keep what nobody has taken, and let the file go."""
        self._left = self.read()
        self.file.close()
