"""Functions of the C library that Python has not, with their errors raised."""

import ctypes
import os


def call(function: str, *arguments: object, what: str = "") -> int:
    """Return what the function answers; it answers with a negative number where it failed.

    Parameters
    ----------
    function : str
        Its name.
    *arguments
        As `ctypes` takes them.
    what : str
        What to call it in an error, where its own name says little.

    Raises
    ------
    OSError
        It failed.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    answer: int = getattr(libc, function)(*arguments)
    if answer < 0:
        code = ctypes.get_errno()
        raise OSError(code, f"{what or function}: {os.strerror(code)}")
    return answer
