"""Functions of the C library that Python lacks, with their errors raised."""

import ctypes
import os


def call(function: str, *arguments: object, what: str = "") -> int:
    """Call the function; `OSError`, which calls it `what`, where its answer is negative."""
    libc = ctypes.CDLL(None, use_errno=True)
    answer: int = getattr(libc, function)(*arguments)
    if answer < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"{what or function}: {os.strerror(code)}")
    return answer
