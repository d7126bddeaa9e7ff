"""Parts of what goes between the monitor and its helpers: each follows its length."""

import io
import struct
from typing import IO, Final

import numpy as np

from plateau.service.judging.denoised import Arrays

_LENGTH: Final = struct.Struct("<Q")


def write_part(stream: IO[bytes], content: bytes | memoryview) -> None:
    """Write a part; the stream may hold it back until it is flushed."""
    stream.write(_LENGTH.pack(len(content)))
    stream.write(content)


def read_part(stream: IO[bytes]) -> bytes:
    """Return the next part; raises EOFError where the stream ends before its end."""
    head = stream.read(_LENGTH.size)
    if len(head) == _LENGTH.size:
        (length,) = _LENGTH.unpack(head)
        content = stream.read(length)
        if len(content) == length:
            return content
    raise EOFError("the stream has ended")


def packed(arrays: Arrays) -> memoryview:
    """Return arrays as one ``.npz`` file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getbuffer()


def unpacked(content: bytes) -> Arrays:
    """Return what was `packed`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
