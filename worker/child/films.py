"""The file through which a render child hands over its films, without a name and of bounded size.

The sum of a slice lies at the beginning, and behind it, where there is one, the glimpse of its
first pass. A scene's films are of one size, so the room for the sum is taken once, when the scene
is loaded: a disk that is full shows before anything is rendered, and a glimpse takes no room that
the sum needs.
"""

import errno
import io
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

_VALUE_BYTES: Final = 4  #: of a channel of a pixel, in float32
_CHUNK_BYTES: Final = 1 << 20


class FilmsNotWritten(Exception):
    """This machine's disk takes no film; the message says why."""


class Films:
    """The films of the scene that is loaded.

    Parameters
    ----------
    file
        An unbuffered file of which nothing else is asked.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._room = 0  # bytes of one film

    def make_room(self, width: int, height: int, channels: int) -> None:
        """Take the room for the sum of a scene of this size, in the place of the one before.

        Raises
        ------
        FilmsNotWritten
            There is none. No room is taken then.
        OSError
            The film is larger than a file of this process may be.
        """
        self._room = width * height * channels * _VALUE_BYTES
        taken = self._file.seek(0, io.SEEK_END)
        try:
            self._file.truncate(min(taken, self._room))
            for at in range(min(taken, self._room), self._room, _CHUNK_BYTES):
                self._write(memoryview(bytes(min(_CHUNK_BYTES, self._room - at))), at)
        except FilmsNotWritten:
            self._file.truncate(0)
            raise

    def write_sum(self, film: NDArray[np.float32]) -> int:
        """Write the sum of a slice; return where it begins. Raises as `make_room`."""
        self._write(_bytes(film), 0)
        return 0

    def write_glimpse(self, film: NDArray[np.float32]) -> int | None:
        """Write the film of a first pass; return where it begins, or None where it finds no room.

        It stays until the next `drop_glimpse`.
        """
        try:
            self._write(_bytes(film), self._room)
        except (FilmsNotWritten, OSError):
            self.drop_glimpse()
            return None
        return self._room

    def drop_glimpse(self) -> None:
        """Give back the room of a glimpse, if there is one."""
        self._file.truncate(self._room)

    def _write(self, rest: memoryview, at: int) -> None:
        self._file.seek(at)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            if error.errno == errno.EFBIG:  # no fault of the disk: the limit on what a scene takes
                raise
            raise FilmsNotWritten(error.strerror or str(error)) from error


def _bytes(film: NDArray[np.float32]) -> memoryview:
    return np.ascontiguousarray(film).data.cast("B")
