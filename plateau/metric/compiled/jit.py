"""The compilation of kernels and the cache of compiled ones.

Kernels follow IEEE 754 strictly: LLVM may neither reorder sums nor contract a·b + c, every fused
multiply-add is explicit, and no kernel calls a mathematics library. So the same numbers give the
same bits on every machine, whatever its vector width. Results of numpy's powers may differ in the
last bit between kinds of CPU: the six weights of the bands, and the image if the view has a gamma.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from platformdirs import user_cache_path

if TYPE_CHECKING:
    from collections.abc import Callable

_Kernel = TypeVar("_Kernel", bound="Callable[..., Any]")

#: Division by zero as in numpy, because Python's rules need a branch in every loop. Without the
#: interpreter's lock, so that other threads run meanwhile, such as one that renews a lease.
_OPTIONS = {"error_model": "numpy", "nogil": True, "fastmath": False}

_PACKAGE = Path(__file__).parent
#: Files of the metric whose code or constants a kernel may contain.
_SOURCES = ("*.py", "compiled/*.py", "cvvdp/*.py", "cvvdp/*.json")


def inlined(function: _Kernel) -> _Kernel:
    """Return the function, inlined into every kernel that calls it."""
    return cast("_Kernel", numba.njit(**_OPTIONS, forceinline=True)(function))


def kernel(function: _Kernel) -> _Kernel:
    """Return the function compiled at its first call from another kernel."""
    return cast("_Kernel", numba.njit(**_OPTIONS)(function))


def entry_point(function: _Kernel) -> _Kernel:
    """Return the function, compiled at its first call and cached for later processes.

    Without a writable folder every process compiles it.
    """
    folder = cache_folder()
    # numba reads the folder once, here; the setting of other code stays.
    elsewhere, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
    try:
        return cast("_Kernel", numba.njit(**_OPTIONS, cache=folder is not None)(function))
    finally:
        numba.config.CACHE_DIR = elsewhere


@cache
def cache_folder() -> Path | None:
    """Return the folder of compiled kernels; None if no folder is writable.

    Its parent is ``NUMBA_CACHE_DIR`` if that is set, else the package's own ``__pycache__``, else
    the user's cache folder. Its name is a digest of the sources, because numba's cache does not
    notice a change of a constant or of an inlined function in another file.
    """
    chosen = numba.config.CACHE_DIR
    places = (
        [Path(chosen)] if chosen else [_PACKAGE / "__pycache__", user_cache_path("plateau-kernels")]
    )
    for place in places:
        folder = place / f"kernels-{_fingerprint()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
    return None


def _fingerprint() -> str:
    """Return a digest of every source whose code or constants a kernel may contain."""
    digest = hashlib.sha256()
    for source in sorted(file for kind in _SOURCES for file in _PACKAGE.parent.glob(kind)):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
