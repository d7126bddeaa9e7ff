"""Finds which of the system libraries that the wheels need are missing here.

Wheels contain most of the libraries that they are linked with, and expect the rest of the system.
Not every system has them: slim images lack libatomic, without which Dr.Jit cannot be loaded.
"""

import ctypes
import sys
from typing import Final

#: Each library's soname and its package on Debian and Ubuntu. The C library is left out: without it
#: Python itself would not run.
PACKAGES: Final = {
    "libatomic.so.1": "libatomic1",
    "libgcc_s.so.1": "libgcc-s1",
    "libstdc++.so.6": "libstdc++6",
    "libz.so.1": "zlib1g",
}


class LibraryMissing(OSError):
    """A library that rendering needs is missing; the message says what to install."""


def missing() -> tuple[str, ...]:
    """Return the sonames that cannot be loaded here; none on systems other than Linux."""
    if sys.platform != "linux":
        return ()
    return tuple(soname for soname in PACKAGES if not _loads(soname))


def told(sonames: tuple[str, ...]) -> str:
    """Return a sentence that says which libraries are missing, and what to install."""
    packages = " ".join(PACKAGES[soname] for soname in sonames)
    are = "are" if len(sonames) > 1 else "is"
    return (
        f"{' and '.join(sonames)} {are} missing on this machine, and Mitsuba cannot be loaded; "
        f"install {'them' if len(sonames) > 1 else 'it'} (Debian, Ubuntu: apt install {packages})"
    )


def check() -> None:
    """Raise `LibraryMissing` if one is missing."""
    sonames = missing()
    if sonames:
        raise LibraryMissing(told(sonames))


def _loads(soname: str) -> bool:
    try:
        ctypes.CDLL(soname)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    # For deploy/setup.sh: the packages to install, if any.
    print(*(PACKAGES[soname] for soname in missing()))
