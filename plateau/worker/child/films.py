"""The unnamed file, of bounded size, in which a render child hands over its films.

The sum of a slice is at the beginning of the file. The film of its first pass, which is shown until
the sum is there (a glimpse), may follow. All films of a scene have one size, so the space for the
sum is taken when the scene is loaded: a full disk is found before anything is rendered, and a
glimpse cannot take the space of the sum.
"""

import errno
import io
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

_VALUE_BYTES: Final = 4  #: of a channel of a pixel, in float32
_CHUNK_BYTES: Final = 1 << 20


class FilmsNotWritten(Exception):
    """This machine's disk takes no film; the message is the reason."""


class Films:
    """The films of the scene that is loaded.

    Parameters
    ----------
    file
        An unbuffered file that nothing else writes.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._room = 0  # bytes of one film

    def make_room(self, width: int, height: int, channels: int) -> None:
        """Take the space for the sums of a scene of this size, instead of the scene before.

        Raises
        ------
        FilmsNotWritten
            The disk has no space; none is taken.
        OSError
            The film is larger than the process's limit on files.
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
        """Write the sum of a slice, and return its position. Raises as `make_room`."""
        self._write(_bytes(film), 0)
        return 0

    def write_glimpse(self, film: NDArray[np.float32]) -> int | None:
        """Write the film of a first pass, and return its position, or None without space.

        It stays until `drop_glimpse`.
        """
        try:
            self._write(_bytes(film), self._room)
        except (FilmsNotWritten, OSError):
            self.drop_glimpse()
            return None
        return self._room

    def write_input(self, number: int, film: NDArray[np.float32]) -> int:
        """Write a sum on the way to that of the slice, and return its position.

        It stays until `drop_glimpse`. Raises as `make_room`.
        """
        at = self._room * (2 + number)
        self._write(_bytes(film), at)
        return at

    def drop_glimpse(self) -> None:
        """Free the space of the glimpse and of inputs, if there are any."""
        self._file.truncate(self._room)

    def _write(self, rest: memoryview, at: int) -> None:
        self._file.seek(at)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            if error.errno == errno.EFBIG:  # the limit on what a scene may take
                raise
            raise FilmsNotWritten(error.strerror or str(error)) from error


def _bytes(film: NDArray[np.float32]) -> memoryview:
    return np.ascontiguousarray(film).data.cast("B")
