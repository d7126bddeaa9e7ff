"""How kernels are compiled, and where the result is kept.

Kernels obey IEEE 754 to the letter: LLVM may neither reorder sums nor contract a·b + c, a fused
multiply-add is written out as one, and no function of a mathematics library is called. So they give
the same bits for the same numbers on every machine, whatever its vectors' width. What comes from
numpy's powers may differ in the last bit between kinds of CPU: the six weights of the bands, and
the image where the view has a gamma.
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

#: numpy's rules for division by zero: Python's would need a branch in every loop. And other threads
#: run meanwhile, such as one that renews a lease.
_OPTIONS = {"error_model": "numpy", "nogil": True, "fastmath": False}

_PACKAGE = Path(__file__).parent


def inlined(function: _Kernel) -> _Kernel:
    """Return the function as part of every kernel that calls it."""
    return cast("_Kernel", numba.njit(**_OPTIONS, forceinline=True)(function))


def kernel(function: _Kernel) -> _Kernel:
    """Return the function compiled at its first call from another kernel."""
    return cast("_Kernel", numba.njit(**_OPTIONS)(function))


def entry_point(function: _Kernel) -> _Kernel:
    """Return the function compiled at its first call ever, and from then on taken from the cache.

    Where no folder can be written to, it is compiled anew in every process.
    """
    folder = cache_folder()
    # numba asks for the folder once, here; what others compile stays where they want it.
    elsewhere, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
    try:
        return cast("_Kernel", numba.njit(**_OPTIONS, cache=folder is not None)(function))
    finally:
        numba.config.CACHE_DIR = elsewhere


@cache
def cache_folder() -> Path | None:
    """Return the folder that compiled kernels are kept in; None where none can be written to.

    It is ``NUMBA_CACHE_DIR`` where that is set, else the package's own ``__pycache__``, else the
    user's cache folder; in it, a folder named after the sources, for numba would take kernels from
    its cache even after a constant or an inlined function in another file had changed.
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
    """Return a digest of every source that a kernel may have taken code or constants from."""
    digest = hashlib.sha256()
    for source in sorted([*_PACKAGE.glob("*.py"), *_PACKAGE.parent.glob("*.py")]):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
