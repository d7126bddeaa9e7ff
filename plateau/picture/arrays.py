"""Arrays by name as one ``.npz`` file, which goes to another process or into a blob."""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]


def packed(arrays: Arrays) -> memoryview:
    """Return arrays as a file."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getbuffer()


def unpacked(content: bytes) -> Arrays:
    """Return what was `packed`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}
