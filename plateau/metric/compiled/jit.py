"""The compilation of kernels.

Kernels follow IEEE 754 strictly: LLVM may neither reorder sums nor contract a·b + c, every fused
multiply-add is explicit, and no kernel calls a mathematics library. So the same numbers give the
same bits on every machine, whatever its vector width. Results of numpy's powers may differ in the
last bit between kinds of CPU: the six weights of the bands, and the image if the view has a gamma.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from plateau.metric.kernel_cache import cache_folder

_Kernel = TypeVar("_Kernel", bound="Callable[..., Any]")

#: Division by zero as in numpy, because Python's rules need a branch in every loop. Without the
#: interpreter's lock, so that other threads run meanwhile, such as one that renews a lease.
_OPTIONS = {"error_model": "numpy", "nogil": True, "fastmath": False}


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
