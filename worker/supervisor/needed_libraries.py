"""The system's libraries that the wheels need, and which of them are missing here.

Wheels bring most of what they are linked with, and leave the rest to the system. Not every system
has all of that: slim images lack libatomic, without which Dr.Jit cannot be loaded.
"""

import ctypes
import sys
from typing import Final

#: Each library by its soname, and the package that has it, on Debian and Ubuntu. The C library is
#: left out: without it there is no Python.
PACKAGES: Final = {
    "libatomic.so.1": "libatomic1",
    "libgcc_s.so.1": "libgcc-s1",
    "libstdc++.so.6": "libstdc++6",
    "libz.so.1": "zlib1g",
}


class LibraryMissing(OSError):
    """A library that rendering needs is not on this machine; the message says what to install."""


def missing() -> tuple[str, ...]:
    """The sonames of those that cannot be loaded here, none where libraries have other names."""
    if sys.platform != "linux":
        return ()
    return tuple(soname for soname in PACKAGES if not _loads(soname))


def told(sonames: tuple[str, ...]) -> str:
    """Which libraries are missing, and what to do, in a sentence."""
    packages = " ".join(PACKAGES[soname] for soname in sonames)
    are = "are" if len(sonames) > 1 else "is"
    return (
        f"{' and '.join(sonames)} {are} missing on this machine, and Mitsuba cannot be loaded; "
        f"install {'them' if len(sonames) > 1 else 'it'} (Debian, Ubuntu: apt install {packages})"
    )


def check() -> None:
    """Return where all are there; raise `LibraryMissing` where one is not."""
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
